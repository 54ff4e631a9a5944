"""The substrate: an external thermal model, an FMU of its own, built with pythonfmu3.

A wall of thickness L that conducts heat in one dimension,

    c dT/dt = d/dx (k dT/dx),   T(0, t) = surface temperature,   T(L, t) = T_0,

with the volumetric heat capacity c = rho C_p. N cells with thickness growing from the surface inwards;
implicit Euler with a time step of its own, whatever the communication step. It takes the temperature of
its surface and gives the heat flux into it, averaged over the communication step, so that what the
other side loses is to the last bit what this side gains.
"""

import numpy as np
from pythonfmu3 import Fmi3Causality, Fmi3Slave, Fmi3Variability, Float64, Unit

UNITS = [
    Unit("s", s=1),
    Unit("m", m=1),
    Unit("K", K=1),
    Unit("W/m^2", kg=1, s=-3),
    Unit("J/m^2", kg=1, s=-2),
    Unit("W/(m.K)", kg=1, m=1, s=-3, K=-1),
    Unit("J/(m^3.K)", kg=1, m=-1, s=-2, K=-1),
]


class Substrate(Fmi3Slave):
    author = "The urlsph authors"
    description = "One-dimensional heat conduction in a wall"

    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.register_units(UNITS)
        independent, continuous = Fmi3Causality.independent, Fmi3Variability.continuous
        self.time = 0.0
        self.register_variable(
            Float64("time", unit="s", causality=independent, variability=continuous)
        )
        parameter, fixed = Fmi3Causality.parameter, Fmi3Variability.fixed
        for name, unit, value, text in [
            ("conductivity", "W/(m.K)", 148.0, "k, of silicon"),
            ("heat_capacity", "J/(m^3.K)", 1.64e6, "c, of silicon"),
            ("thickness", "m", 2e-4, "L"),
            ("initial_temperature", "K", 298.0, "T_0, and of the back"),
            ("own_step", "s", 5e-10, "Longest time step of the wall"),
        ]:
            self.add(name, unit, value, text, parameter, fixed)
        name, text = "surface_temperature", "At the end of the communication step"
        self.add(name, "K", 298.0, text, Fmi3Causality.input, continuous)
        for name, unit, text in [
            ("heat_flux", "W/m^2", "Into the wall, mean over the last communication step"),
            ("heat_in", "J/m^2", "Through the surface since the start"),
            ("heat_out", "J/m^2", "Through the back since the start"),
            ("stored", "J/m^2", "In the wall since the start"),
        ]:
            self.add(name, unit, 0.0, text, Fmi3Causality.output, continuous)

    def add(self, name, unit, value, description, causality, variability):
        setattr(self, name, value)
        kind = {"unit": unit, "description": description}
        self.register_variable(Float64(name, causality=causality, variability=variability, **kind))

    def exit_initialization_mode(self):
        growth = 1.06 ** np.arange(80)
        self.size = self.thickness * growth / growth.sum()
        self.temperature = np.full(len(growth), self.initial_temperature)
        self.last_surface = self.initial_temperature
        # k over the distance between the places where the temperatures are: the surface, the middles
        # of the cells, the back.
        half = 0.5 * self.size
        gaps = np.concatenate([half[:1], half[:-1] + half[1:], half[-1:]])
        self.conductance = self.conductivity / gaps

    def do_step(self, current_time, step_size):
        steps = max(1, round(step_size / self.own_step))
        dt = step_size / steps
        mass = self.heat_capacity * self.size / dt
        g = self.conductance
        matrix = np.diag(mass + g[:-1] + g[1:]) - np.diag(g[1:-1], 1) - np.diag(g[1:-1], -1)
        inverse = np.linalg.inv(matrix)
        before = self.heat_in
        for i in range(steps):
            # The surface goes from its last temperature to the new one along a straight line.
            share = (i + 1) / steps
            surface = (1 - share) * self.last_surface + share * self.surface_temperature
            right = mass * self.temperature
            right[0] += g[0] * surface
            right[-1] += g[-1] * self.initial_temperature
            self.temperature = inverse @ right
            self.heat_in += dt * g[0] * (surface - self.temperature[0])
            self.heat_out += dt * g[-1] * (self.temperature[-1] - self.initial_temperature)
        self.heat_flux = (self.heat_in - before) / step_size
        rise = self.temperature - self.initial_temperature
        self.stored = self.heat_capacity * float(self.size @ rise)
        self.last_surface = self.surface_temperature
        return True
