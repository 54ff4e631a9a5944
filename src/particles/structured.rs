//! Bodies of hexahedra that follow a shape.

use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_4};

use super::NONE;
use super::mesh::{Cell, CellKind, Grid};
use crate::scene::{Axis, BoxGeometry, CylinderGeometry, Grading, PerforatedBox, Sector};

/// A random number in [-1, 1) for a node and a component: the hash of SplitMix64, the same anywhere.
fn random(seed: u32, node: usize, component: usize) -> f64 {
    let mut z = (u64::from(seed) << 32)
        .wrapping_add(3 * node as u64 + component as u64)
        .wrapping_mul(0x9e37_79b9_7f4a_7c15)
        .wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 * (1.0 / (1u64 << 52) as f64) - 1.0
}

/// A box with graded spacing or moved nodes. The caller's order is lexicographic, X first; the body's
/// has the shortest axis first.
pub(super) fn block(b: &BoxGeometry) -> Grid {
    let lines: [Vec<f64>; 3] = std::array::from_fn(|a| {
        let fractions = Grading::fractions(b.graded(a), b.cells(a) as usize);
        let place = |s: f64| b.min[a] + s * (b.max[a] - b.min[a]);
        let mut lines: Vec<f64> = fractions.into_iter().map(place).collect();
        // The bound itself, without the round-off of the sum.
        lines.pop();
        lines.push(b.max[a]);
        lines
    });
    let size = [0, 1, 2].map(|a| lines[a].len());
    let index = |[i, j, k]: [usize; 3]| ((k * size[1] + j) * size[0] + i) as u32;
    let sites = |size: [usize; 3], axes: [usize; 3]| {
        (0..size[axes[2]]).flat_map(move |k| {
            (0..size[axes[1]]).flat_map(move |j| {
                (0..size[axes[0]]).map(move |i| {
                    let mut site = [0; 3];
                    (site[axes[0]], site[axes[1]], site[axes[2]]) = (i, j, k);
                    site
                })
            })
        })
    };
    let nodes = sites(size, [0, 1, 2])
        .map(|site| {
            let mut x: [f64; 3] = std::array::from_fn(|a| lines[a][site[a]]);
            let inside = (0..3).all(|a| site[a] > 0 && site[a] + 1 < size[a]);
            if let (Some(jitter), true) = (b.jitter, inside) {
                for a in 0..3 {
                    let way = jitter.fraction * random(jitter.seed, index(site) as usize, a);
                    let l = &lines[a][site[a] - 1..=site[a] + 1];
                    x[a] += way * if way < 0.0 { l[1] - l[0] } else { l[2] - l[1] };
                }
            }
            x
        })
        .collect();
    let count = size.map(|n| n - 1);
    let mut cells = Vec::with_capacity(count.iter().product());
    let mut named = Vec::new();
    for site in sites(count, [0, 1, 2]) {
        let corner =
            |di: usize, dj: usize, dk: usize| index([site[0] + di, site[1] + dj, site[2] + dk]);
        cells.push(Cell::new(
            CellKind::Hexahedron,
            &[
                corner(0, 0, 0),
                corner(1, 0, 0),
                corner(1, 1, 0),
                corner(0, 1, 0),
                corner(0, 0, 1),
                corner(1, 0, 1),
                corner(1, 1, 1),
                corner(0, 1, 1),
            ],
        ));
        for axis in 0..3 {
            for (side, end) in [(0, 0), (1, count[axis] - 1)] {
                if site[axis] == end {
                    let face = [[0, 0], [1, 0], [1, 1], [0, 1]].map(|[u, v]| {
                        let mut d = [0; 3];
                        (d[axis], d[(axis + 1) % 3], d[(axis + 2) % 3]) = (side, u, v);
                        corner(d[0], d[1], d[2])
                    });
                    named.push((face, (2 * axis + side) as u32));
                }
            }
        }
    }
    let mut axes = [0, 1, 2];
    axes.sort_by_key(|&a| size[a]);
    Grid {
        nodes,
        cells,
        names: ["x_min", "x_max", "y_min", "y_max", "z_min", "z_max"]
            .map(String::from)
            .into(),
        named,
        numbering: Some(sites(size, axes).map(index).collect()),
    }
}

/// A plane figure of triangles and quadrilaterals, corners counter-clockwise.
#[derive(Default)]
struct Section {
    nodes: Vec<[f64; 2]>,
    /// The fourth corner is `NONE` in a triangle.
    cells: Vec<[u32; 4]>,
    /// Boundary edges with the index of their name.
    edges: Vec<([u32; 2], u32)>,
    /// Names of the edges.
    names: Vec<String>,
}

impl Section {
    fn node(&mut self, x: [f64; 2]) -> u32 {
        self.nodes.push(x);
        self.nodes.len() as u32 - 1
    }

    /// Moves the section along an axis through the given fractions of the length; `place` maps a point
    /// of the section and a fraction to (u, v, w), w along the axis. The caller's order is section by
    /// section; in memory a line along the axis is contiguous, so that the particles of a line have
    /// their neighbours at the same distances.
    fn extrude(
        self,
        axis: Axis,
        fractions: &[f64],
        ends: [String; 2],
        place: impl Fn([f64; 2], f64) -> [f64; 3],
    ) -> Grid {
        let (size, layers) = (self.nodes.len() as u32, fractions.len() as u32);
        let [u, v, w] = axis.directions();
        let mut nodes = Vec::with_capacity(self.nodes.len() * fractions.len());
        for s in fractions {
            for x in &self.nodes {
                let mut point = [0.0; 3];
                [point[u], point[v], point[w]] = place(*x, *s);
                nodes.push(point);
            }
        }
        let mut names = self.names;
        let first_end = names.len() as u32;
        names.extend(ends);
        let mut cells = Vec::with_capacity(self.cells.len() * (fractions.len() - 1));
        let mut named = Vec::new();
        let raised = |corners: [u32; 4], layer: u32| {
            corners.map(|n| if n == NONE { NONE } else { n + layer * size })
        };
        for layer in 1..layers {
            for corners in &self.cells {
                let (below, above) = (raised(*corners, layer - 1), raised(*corners, layer));
                cells.push(if corners[3] == NONE {
                    let [a, b, c, _] = below;
                    let [d, e, f, _] = above;
                    Cell::new(CellKind::Prism, &[a, b, c, d, e, f])
                } else {
                    Cell::new(CellKind::Hexahedron, &[below, above].concat())
                });
            }
            for ([a, b], name) in &self.edges {
                let (below, above) = ((layer - 1) * size, layer * size);
                named.push(([a + below, b + below, b + above, a + above], *name));
            }
        }
        for corners in &self.cells {
            named.push((*corners, first_end));
            named.push((raised(*corners, layers - 1), first_end + 1));
        }
        let numbering = (0..size).flat_map(|n| (0..layers).map(move |layer| n + layer * size));
        Grid {
            nodes,
            cells,
            names,
            named,
            numbering: Some(numbering.collect()),
        }
    }
}

/// Unit vector towards a point of the boundary of the square [-1, 1]^2, at angles that grow evenly
/// along its sides; exactly symmetric.
fn direction([s, t]: [f64; 2]) -> [f64; 2] {
    let pair = |ratio: f64| {
        if ratio == 1.0 {
            (FRAC_1_SQRT_2, FRAC_1_SQRT_2)
        } else {
            ((FRAC_PI_4 * ratio).cos(), (FRAC_PI_4 * ratio).sin())
        }
    };
    if s.abs() >= t.abs() {
        let (cos, sin) = pair((t / s).abs());
        [cos.copysign(s), sin.copysign(t)]
    } else {
        let (cos, sin) = pair((s / t).abs());
        [sin.copysign(s), cos.copysign(t)]
    }
}

/// A cylinder, or a sector of one.
pub(super) fn cylinder(c: &CylinderGeometry) -> Grid {
    let n = c.divisions as i32;
    let radial = Grading::fractions(c.radial_grading.as_ref(), c.divisions as usize);
    let section = match c.sector {
        Sector::Full => disc(n, [-n, -n], 4, &radial),
        Sector::Half => disc(n, [-n, 0], 2, &radial),
        Sector::Quarter => disc(n, [0, 0], 1, &radial),
        Sector::Wedge(degrees) => wedge(degrees.to_radians(), &radial),
    };
    let layers = Grading::fractions(c.grading.as_ref(), c.layers as usize);
    let axis = c.axis;
    let [u, v, w] = axis.directions();
    section.extrude(
        axis,
        &layers,
        ["bottom".into(), "top".into()],
        |[x, y], s| {
            let radius = c.radius * c.radius_factor(s);
            [
                c.base[u] + radius * x,
                c.base[v] + radius * y,
                c.base[w] + s * c.length,
            ]
        },
    )
}

/// Names of the faces of a sector, in the order of [`CylinderGeometry::faces`].
fn sector_names() -> Vec<String> {
    ["side", "start", "end"].map(String::from).into()
}

/// Quarters of the unit disc: a core of squares, n to a quarter's edge, whose sides bulge, and n rings
/// around it. `first` is the core's lowest site.
fn disc(n: i32, first: [i32; 2], quarters: i32, radial: &[f64]) -> Section {
    /// Radius of the core on the axes and at its corners, of the disc's. The sizes of the cells vary
    /// by less than two, and three cells meet at a corner under 115 to 130 degrees.
    const CORE: [f64; 2] = [0.52, 0.64];
    let mut section = Section {
        names: sector_names(),
        ..Section::default()
    };
    let unit = |i: i32| f64::from(i) / f64::from(n);
    let columns = n - first[0] + 1;
    let core = |[i, j]: [i32; 2]| ((j - first[1]) * columns + i - first[0]) as u32;
    let rim_of_core = |at: [f64; 2]| {
        let ratio = at[0].abs().min(at[1].abs());
        let radius = CORE[0] + (CORE[1] - CORE[0]) * ratio * ratio;
        direction(at).map(|d| radius * d)
    };
    for j in first[1]..=n {
        for i in first[0]..=n {
            let at = [unit(i), unit(j)];
            let r = at[0].abs().max(at[1].abs());
            // Squares in the middle, bulging more and more outwards.
            section.node(if r == 0.0 {
                [0.0; 2]
            } else {
                let rim = rim_of_core(at.map(|s| s / r));
                std::array::from_fn(|c| (1.0 - r) * CORE[0] * at[c] + r * r * rim[c])
            });
        }
    }
    for j in first[1]..n {
        for i in first[0]..n {
            let corners = [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]];
            section.cells.push(corners.map(core));
        }
    }
    // Sites of the core's rim by ray, counter-clockwise from the u axis.
    let site = |ray: i32| match ray {
        k if k <= n => [n, k],
        k if k <= 3 * n => [2 * n - k, n],
        k if k <= 5 * n => [-n, 4 * n - k],
        k if k <= 7 * n => [k - 6 * n, -n],
        k => [n, k - 8 * n],
    };
    let rays = 2 * n * quarters;
    let closed = quarters == 4;
    let count = if closed { rays } else { rays + 1 };
    let mut ring: Vec<u32> = (0..count).map(|k| core(site(k))).collect();
    for tau in &radial[1..] {
        let next: Vec<u32> = (0..count)
            .map(|k| {
                let at = site(k).map(unit);
                let (inner, outer) = (rim_of_core(at), direction(at));
                section.node(std::array::from_fn(|c| {
                    if *tau == 1.0 {
                        outer[c]
                    } else {
                        (1.0 - tau) * inner[c] + tau * outer[c]
                    }
                }))
            })
            .collect();
        for k in 0..rays as usize {
            let l = (k + 1) % count as usize;
            section.cells.push([ring[k], next[k], next[l], ring[l]]);
        }
        if !closed {
            let last = count as usize - 1;
            section.edges.push(([ring[0], next[0]], 1));
            section.edges.push(([next[last], ring[last]], 2));
        }
        ring = next;
    }
    for k in 0..rays as usize {
        let l = (k + 1) % count as usize;
        section.edges.push(([ring[k], ring[l]], 0));
    }
    if !closed {
        let end = if quarters == 1 { [0, n] } else { [-n, 0] };
        for i in 0..n {
            section.edges.push(([core([i, 0]), core([i + 1, 0])], 1));
            let inner = end.map(|e| e.signum() * i);
            let outer = end.map(|e| e.signum() * (i + 1));
            section.edges.push(([core(outer), core(inner)], 2));
        }
    }
    section
}

/// A sector of the unit disc around its axis: triangles at the axis, and rings with as many cells as
/// make them about as wide as they are long.
fn wedge(angle: f64, radial: &[f64]) -> Section {
    let mut section = Section {
        names: sector_names(),
        ..Section::default()
    };
    let mut ring = vec![section.node([0.0; 2])];
    for (i, pair) in radial.windows(2).enumerate() {
        let (inner, outer) = (pair[0], pair[1]);
        let wide = (angle * outer / (outer - inner)).round().max(1.0) as usize;
        // A ring has at least the cells of the one inside it.
        let cells = if i == 0 {
            wide
        } else {
            wide.max(ring.len() - 1)
        };
        let next: Vec<u32> = (0..=cells)
            .map(|k| {
                let phi = angle * k as f64 / cells as f64;
                section.node([outer * phi.cos(), outer * phi.sin()])
            })
            .collect();
        if ring.len() == next.len() {
            for k in 0..cells {
                let corners = [ring[k], next[k], next[k + 1], ring[k + 1]];
                section.cells.push(corners);
            }
        } else {
            // Triangles between rings of different numbers: on each side in turn, as it lags behind.
            let (mut p, mut q) = (0, 0);
            let (inside, outside) = (ring.len() - 1, cells);
            while p < inside || q < outside {
                let outward = p == inside
                    || q < outside && (2 * q + 1) * inside.max(1) <= (2 * p + 1) * outside;
                if outward {
                    section.cells.push([ring[p], next[q], next[q + 1], NONE]);
                    q += 1;
                } else {
                    section.cells.push([ring[p], next[q], ring[p + 1], NONE]);
                    p += 1;
                }
            }
        }
        section.edges.push(([ring[0], next[0]], 1));
        section.edges.push(([next[cells], ring[ring.len() - 1]], 2));
        ring = next;
    }
    for pair in ring.windows(2) {
        section.edges.push(([pair[0], pair[1]], 0));
    }
    section
}

/// A box with a grid of through-holes: tiles of rings around each hole.
pub(super) fn perforated(b: &PerforatedBox) -> Grid {
    let [u, v, w] = b.along.directions();
    let (k, rings) = (b.divisions as usize, b.rings as usize);
    let tiles = b.tiles.map(|t| t as usize);
    let size = tiles.map(|t| t * k + 1);
    let line = |axis: usize, tiles: usize, i: usize| {
        let s = i as f64 / (tiles * k) as f64;
        if i == tiles * k {
            b.max[axis]
        } else {
            b.min[axis] + s * (b.max[axis] - b.min[axis])
        }
    };
    let mut section = Section {
        names: b.side_names(),
        ..Section::default()
    };
    let mut on_lattice = vec![NONE; size[0] * size[1]];
    let mut lattice_node = |section: &mut Section, i: usize, j: usize| {
        let known = &mut on_lattice[j * size[0] + i];
        if *known == NONE {
            *known = section.node([line(u, tiles[0], i), line(v, tiles[1], j)]);
        }
        *known
    };
    for tile_v in 0..tiles[1] {
        for tile_u in 0..tiles[0] {
            let (i0, j0) = (tile_u * k, tile_v * k);
            if b.solid.contains(&[tile_u as u32, tile_v as u32]) {
                for j in j0..j0 + k {
                    for i in i0..i0 + k {
                        let corners = [[0, 0], [1, 0], [1, 1], [0, 1]];
                        let cell = corners.map(|[p, q]| lattice_node(&mut section, i + p, j + q));
                        section.cells.push(cell);
                    }
                }
                continue;
            }
            // Sites on the tile's rim, counter-clockwise from its lower corner.
            let site = |at: usize| match (at / k, at % k) {
                (0, r) => [r, 0],
                (1, r) => [k, r],
                (2, r) => [k - r, k],
                (_, r) => [0, k - r],
            };
            let middle = [
                0.5 * (line(u, tiles[0], i0) + line(u, tiles[0], i0 + k)),
                0.5 * (line(v, tiles[1], j0) + line(v, tiles[1], j0 + k)),
            ];
            let mut ring: Vec<u32> = Vec::new();
            for level in 0..=rings {
                let tau = level as f64 / rings as f64;
                let next: Vec<u32> = (0..4 * k)
                    .map(|at| {
                        let [i, j] = site(at);
                        if level == rings {
                            return lattice_node(&mut section, i0 + i, j0 + j);
                        }
                        let outer = [line(u, tiles[0], i0 + i), line(v, tiles[1], j0 + j)];
                        // From -1 to 1 across the tile.
                        let across = [i, j].map(|i| (2.0 * i as f64 - k as f64) / k as f64);
                        let to_rim = direction(across).map(|d| 0.5 * b.diameter * d);
                        section.node(std::array::from_fn(|c| {
                            (1.0 - tau) * (middle[c] + to_rim[c]) + tau * outer[c]
                        }))
                    })
                    .collect();
                for at in 0..4 * k {
                    let after = (at + 1) % (4 * k);
                    if level == 0 {
                        section.edges.push(([next[at], next[after]], 4));
                    } else {
                        section
                            .cells
                            .push([ring[at], next[at], next[after], ring[after]]);
                    }
                }
                ring = next;
            }
        }
    }
    for i in 0..size[0] - 1 {
        for (j, name) in [(0, 2), (size[1] - 1, 3)] {
            let edge = [on_lattice[j * size[0] + i], on_lattice[j * size[0] + i + 1]];
            section.edges.push((edge, name));
        }
    }
    for j in 0..size[1] - 1 {
        for (i, name) in [(0, 0), (size[0] - 1, 1)] {
            let edge = [
                on_lattice[j * size[0] + i],
                on_lattice[(j + 1) * size[0] + i],
            ];
            section.edges.push((edge, name));
        }
    }
    let layers = Grading::fractions(b.grading.as_ref(), b.layers as usize);
    section.extrude(b.along, &layers, b.end_names(), |[x, y], s| {
        let z = if s == 1.0 {
            b.max[w]
        } else {
            b.min[w] + s * (b.max[w] - b.min[w])
        };
        [x, y, z]
    })
}
