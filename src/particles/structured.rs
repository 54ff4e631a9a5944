//! Bodies of hexahedra that follow a shape.

use super::mesh::{Cell, CellKind, Grid};
use crate::scene::{BoxGeometry, Grading};

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
