"""Both layers as one: the exact answer that the coupled FMUs have to give.

Heat conduction in one dimension through film and substrate, finite volumes, Crank-Nicolson in time,
both much finer than the FMUs. The film's heat capacity is that at constant axial stress, because the
free surface lets it expand: c_v (1 + theta_R Gamma_0^2 c_v / (kappa + 4/3 mu)), to first order.
"""

import math

import numpy as np


def film_heat_capacity(scene):
    """Heat capacity of the film per unit volume [J/(m^3 K)]."""
    material, heat = scene["material"]["neo_hookean"], scene["heat"]
    young, nu = material["youngs_modulus"], material["poisson_ratio"]
    modulus = young * (1 - nu) / ((1 + nu) * (1 - 2 * nu))
    c_v = material["density"] * heat["specific_heat"]
    theta_r, gamma = heat["reference_temperature"], heat["gruneisen_coefficient"]
    return c_v * (1 + theta_r * gamma**2 * c_v / modulus)


class Pulse:
    """The laser: q = peak exp(-((t - middle) / width)^2), as in the scene [W/m^2]."""

    peak, middle, width = 3.7613e10, 8e-8, 3e-8

    def energy(self, t):
        """Supplied until t [J/m^2]."""
        erf = [math.erf((x - self.middle) / self.width) for x in (0.0, t)]
        return 0.5 * math.sqrt(math.pi) * self.peak * self.width * (erf[1] - erf[0])


def temperatures(scene, substrate, times, cells=200, steps=10):
    """Temperatures of the film's surface and of the interface at `times`, which are equally spaced;
    with `cells` in the film and `steps` per interval."""
    film = scene["geometry"]["box"]["max"][1]
    start = scene["heat"]["reference_temperature"]
    growth = 1.03 ** np.arange(220)
    sizes = np.concatenate([np.full(cells, film / cells), substrate["thickness"] * growth / growth.sum()])
    in_film = np.arange(len(sizes)) < cells
    k = np.where(in_film, scene["heat"]["conductivity"], substrate["conductivity"])
    c = np.where(in_film, film_heat_capacity(scene), substrate["heat_capacity"])
    resistance = sizes / (2 * k)
    g = 1 / (resistance[:-1] + resistance[1:])
    back = 1 / resistance[-1]
    operator = np.diag(-np.concatenate([[0.0], g]) - np.concatenate([g, [back]]))
    operator += np.diag(g, 1) + np.diag(g, -1)
    dt = (times[1] - times[0]) / steps
    mass = np.diag(c * sizes / dt)
    advance = np.linalg.inv(mass - operator / 2)
    explicit = mass + operator / 2
    pulse = Pulse()
    rise = np.zeros(len(sizes))
    surface, interface = [], []

    def record(flux):
        surface.append(start + rise[0] + flux * resistance[0])
        # The same flux on both sides of the interface.
        left, right = cells - 1, cells
        weights = 1 / resistance[left], 1 / resistance[right]
        value = weights[0] * rise[left] + weights[1] * rise[right]
        interface.append(start + value / sum(weights))

    record(0.0)
    for i in range(1, len(times)):
        for j in range(steps):
            t = times[i - 1] + j * dt
            right = explicit @ rise
            right[0] += (pulse.energy(t + dt) - pulse.energy(t)) / dt
            rise = advance @ right
        t = times[i]
        record(pulse.peak * math.exp(-(((t - pulse.middle) / pulse.width) ** 2)))
    return np.array(surface), np.array(interface)
