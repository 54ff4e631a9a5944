"""Reference solutions of the column that belong to neither side."""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre

# The column: [-0.5, 0.5] x [0, 6] x [-0.5, 0.5] m, clamped at Y = 0.
HALF_WIDTH, LENGTH = 0.5, 6.0

# Which polynomials in X and in Z, even (0) or odd (1), a displacement of this symmetry is made of:
# one pair for each of its components.
TWISTING = ((0, 1), (1, 1), (1, 0))
BENDING = ((0, 0), (1, 0), (1, 1))


@dataclass
class Elastic:
    """An isotropic elastic material."""

    density: float
    youngs_modulus: float
    poisson_ratio: float

    @property
    def mu(self):
        return self.youngs_modulus / (2 * (1 + self.poisson_ratio))

    @property
    def kappa(self):
        return self.youngs_modulus / (3 * (1 - 2 * self.poisson_ratio))

    @property
    def p_wave_modulus(self):
        return self.kappa + 4 / 3 * self.mu


class Basis:
    """Legendre polynomials over an interval: values and derivatives at points, one row a polynomial.
    Clamped ones are multiplied by the distance from the lower end."""

    def __init__(self, degrees, low, high, clamped=False):
        self.degrees, self.low, self.high, self.clamped = degrees, low, high, clamped

    def at(self, points):
        scale = 2 / (self.high - self.low)
        xi = scale * (points - self.low) - 1
        unit = np.eye(max(self.degrees) + 1)
        values = np.array([legendre.legval(xi, unit[k]) for k in self.degrees])
        slopes = np.array([scale * legendre.legval(xi, legendre.legder(unit[k])) for k in self.degrees])
        if self.clamped:
            distance = points - self.low
            values, slopes = values * distance, slopes * distance + values
        return values, slopes


def linear_column(material, symmetry, velocity, times, *, across, along):
    """Displacement of the top corner (0.5, 6, 0.5) by linear elastodynamics, times x 3.

    Ritz' method: polynomials of a symmetry, fewer than `across` in X and Z and `along` in Y, and the
    exact motion of all their modes. `velocity` is the initial one, three components from X, Y and Z.
    """
    nodes, weights = legendre.leggauss(max(across, along) + 4)
    points = [HALF_WIDTH * nodes, LENGTH / 2 * (nodes + 1), HALF_WIDTH * nodes]
    weights = [HALF_WIDTH * weights, LENGTH / 2 * weights, HALF_WIDTH * weights]
    bases = [
        (
            Basis(range(x, across, 2), -HALF_WIDTH, HALF_WIDTH),
            Basis(range(along), 0, LENGTH, clamped=True),
            Basis(range(z, across, 2), -HALF_WIDTH, HALF_WIDTH),
        )
        for x, z in symmetry
    ]
    tables = [[basis.at(points[d]) for d, basis in enumerate(component)] for component in bases]

    def product(factors):
        """The tensor product of what belongs to X, Y and Z."""
        x, y, z = factors
        return np.kron(np.kron(x, y), z)

    def integral(a, b, da=None, db=None):
        """Of the basis of component a, derived by axis da, times that of b, derived by db."""
        return product(
            [(tables[a][d][da == d] * weights[d]) @ tables[b][d][db == d].T for d in range(3)]
        )

    mu, kappa = material.mu, material.kappa
    lame = kappa - 2 / 3 * mu
    stiffness = [[None] * 3 for _ in range(3)]
    mass = [[None] * 3 for _ in range(3)]
    for a in range(3):
        for b in range(3):
            stiffness[a][b] = lame * integral(a, b, a, b) + mu * integral(a, b, b, a)
            if a == b:
                stiffness[a][a] += mu * sum(integral(a, a, d, d) for d in range(3))
            mass[a][b] = material.density * integral(a, a) if a == b else np.zeros_like(stiffness[a][b])
    stiffness, mass = np.block(stiffness), np.block(mass)

    grid = np.meshgrid(*points, indexing="ij")
    momentum = np.concatenate(
        [
            material.density
            * np.einsum(
                "ax,by,cz,xyz->abc",
                *(tables[a][d][0] * weights[d] for d in range(3)),
                np.broadcast_to(component, grid[0].shape),
                optimize=True,
            ).ravel()
            for a, component in enumerate(velocity(*grid))
        ]
    )

    root = np.linalg.inv(np.linalg.cholesky(mass))
    squares, modes = np.linalg.eigh(root @ stiffness @ root.T)
    frequencies = np.sqrt(squares)
    modes = root.T @ modes
    motion = np.sin(np.outer(times, frequencies)) * (modes.T @ momentum / frequencies)

    corner = (HALF_WIDTH, LENGTH, HALF_WIDTH)
    at_corner = [
        product([basis.at(np.array([corner[d]]))[0][:, 0] for d, basis in enumerate(component)])
        for component in bases
    ]
    ends = np.cumsum([len(values) for values in at_corner])
    return np.stack(
        [motion @ (values @ modes[end - len(values) : end]) for values, end in zip(at_corner, ends)],
        axis=1,
    )


def neo_hookean(material):
    """Nominal stress under a uniaxial stretch, the sides held: urlsph's law."""
    return lambda stretch: (
        2 / 3 * material.mu * (stretch ** (1 / 3) - stretch ** (-5 / 3)) + material.kappa * (stretch - 1)
    )


def logarithmic(material):
    """The same of SMD's linear strength and linear equation of state: their stress rate, integrated."""
    return lambda stretch: material.p_wave_modulus * np.log(stretch)


def uniaxial_column(material, stress, top_velocity, end, *, cells=500):
    """Times and displacements of the top of the column in uniaxial strain, set moving with a velocity
    that is linear in Y; by central differences."""
    size = LENGTH / cells
    steps = int(np.ceil(end / (0.5 * size / np.sqrt(material.p_wave_modulus / material.density))))
    dt = end / steps
    mass = np.full(cells, material.density * size)
    mass[-1] /= 2
    velocity = top_velocity * np.arange(1, cells + 1) / cells
    displacement = np.zeros(cells + 1)
    tension = np.zeros(cells + 1)  # Of the cells; beyond the top there is none.
    top = [0.0]
    for _ in range(steps):
        velocity += dt * np.diff(tension) / mass
        displacement[1:] += dt * velocity
        tension[:-1] = stress(1 + np.diff(displacement) / size)
        top.append(displacement[-1])
    return np.linspace(0, end, steps + 1), np.array(top)
