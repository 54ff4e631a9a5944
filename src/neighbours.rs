//! Neighbour lists: positions in, a symmetric graph out. Nothing else is touched.

use std::collections::{HashMap, HashSet};

use crate::error::{Error, Result};
use crate::parallel;
use crate::particles::{Lattice, Mesh, Particles, Shape, Sharing};
use crate::scene::Neighbours;

/// Neighbours of every particle, ascending, without the particle itself; body's order.
#[derive(Debug, Clone, PartialEq)]
pub struct Graph {
    start: Vec<usize>,
    to: Vec<u32>,
}

impl Graph {
    /// The graph of a scene's particles.
    ///
    /// # Errors
    /// [`Code::InvalidScene`](crate::Code::InvalidScene) naming an isolated particle or a part of
    /// the body that hangs on nothing.
    pub fn new(particles: &Particles, neighbours: Neighbours) -> Result<Self> {
        let lists = match (&particles.shape, neighbours) {
            (Shape::Lattice(lattice), Neighbours::Lattice(number)) => {
                lattice_lists(lattice, particles.count(), number)
            }
            (Shape::Lattice(lattice), Neighbours::Radius { radius }) => radius_lists(
                &particles.positions,
                radius * lattice.largest_spacing(),
                lattice,
            ),
            (Shape::Mesh(mesh), Neighbours::Lattice(number)) => {
                let sharing = match number {
                    6 => Sharing::Edge,
                    18 => Sharing::Face,
                    _ => Sharing::Cell,
                };
                parallel::fill(particles.count(), |i| mesh.neighbours(i as u32, sharing))
            }
            (Shape::Mesh(mesh), Neighbours::Radius { radius }) => {
                mesh_radius_lists(&particles.positions, radius, mesh)
            }
        };
        let graph = Self::from_lists(lists);
        graph.check_connected(particles)?;
        Ok(graph)
    }

    fn from_lists(lists: Vec<Vec<u32>>) -> Self {
        let mut start = Vec::with_capacity(lists.len() + 1);
        let mut to = Vec::with_capacity(lists.iter().map(Vec::len).sum());
        start.push(0);
        for list in lists {
            to.extend_from_slice(&list);
            start.push(to.len());
        }
        Self { start, to }
    }

    /// Neighbours of a particle.
    pub fn of(&self, particle: usize) -> &[u32] {
        &self.to[self.start[particle]..self.start[particle + 1]]
    }

    /// Particles.
    pub fn count(&self) -> usize {
        self.start.len() - 1
    }

    /// Directed pairs.
    pub fn pairs(&self) -> usize {
        self.to.len()
    }

    fn check_connected(&self, particles: &Particles) -> Result<()> {
        let place = |i: usize| (particles.caller(i), Some(particles.positions[i]));
        if let Some(i) = (0..self.count()).find(|i| self.of(*i).is_empty()) {
            let (particle, position) = place(i);
            return Err(Error::scene(
                "numerics.neighbours",
                "a particle has no neighbours: widen the radius or refine the spacing",
            )
            .at_particle(particle, position));
        }
        let mut seen = vec![false; self.count()];
        let mut stack = vec![0usize];
        seen[0] = true;
        while let Some(i) = stack.pop() {
            for &b in self.of(i) {
                if !std::mem::replace(&mut seen[b as usize], true) {
                    stack.push(b as usize);
                }
            }
        }
        if let Some(i) = seen.iter().position(|s| !s) {
            let (particle, position) = place(i);
            return Err(Error::scene(
                "geometry",
                "the body falls into parts that are not connected: let boxes share a face and the \
                 parts of a mesh their nodes, or make a scene of each part",
            )
            .at_particle(particle, position));
        }
        Ok(())
    }
}

fn lattice_lists(lattice: &Lattice, count: usize, number: u8) -> Vec<Vec<u32>> {
    let reach = match number {
        6 => 1,
        18 => 2,
        _ => 3,
    };
    let mut offsets = Vec::new();
    for z in -1..=1i32 {
        for y in -1..=1i32 {
            for x in -1..=1i32 {
                let away = x.abs() + y.abs() + z.abs();
                if away > 0 && away <= reach {
                    offsets.push([x, y, z]);
                }
            }
        }
    }
    parallel::fill(count, |i| {
        let mut list: Vec<u32> = offsets
            .iter()
            .filter_map(|o| lattice.neighbour(i, *o))
            .collect();
        list.sort_unstable();
        list
    })
}

/// Cell list with cells as wide as the radius.
fn radius_lists(positions: &[[f64; 3]], radius: f64, lattice: &Lattice) -> Vec<Vec<u32>> {
    // Round-off in the coordinates must not make a list asymmetric or drop a lattice shell.
    let radius = radius * (1.0 + 1e-9);
    let cell = |x: &[f64; 3]| x.map(|v| (v / radius).floor() as i64);
    let mut cells: HashMap<[i64; 3], Vec<u32>> = HashMap::new();
    for (i, x) in positions.iter().enumerate() {
        cells.entry(cell(x)).or_default().push(i as u32);
    }
    let reach = radius * radius;
    // Particles on two sides of a gap or a notch are no neighbours: what lies between must be body.
    let whole = lattice.is_box();
    let spacing = lattice.smallest_spacing();
    let joined = |x: [f64; 3], y: [f64; 3], distance: f64| {
        let samples = (2.0 * distance / spacing).ceil() as usize;
        whole
            || (0..samples).all(|i| {
                let s = (i as f64 + 0.5) / samples as f64;
                lattice.contains(std::array::from_fn(|a| x[a] + s * (y[a] - x[a])))
            })
    };
    parallel::fill(positions.len(), |i| {
        let (x, centre) = (positions[i], cell(&positions[i]));
        let mut list = Vec::new();
        for dz in -1..=1 {
            for dy in -1..=1 {
                for dx in -1..=1 {
                    let key = [centre[0] + dx, centre[1] + dy, centre[2] + dz];
                    for &b in cells.get(&key).into_iter().flatten() {
                        let d: f64 = (0..3)
                            .map(|a| (positions[b as usize][a] - x[a]).powi(2))
                            .sum();
                        if b as usize != i
                            && d <= reach
                            && joined(x, positions[b as usize], d.sqrt())
                        {
                            list.push(b);
                        }
                    }
                }
            }
        }
        list.sort_unstable();
        list
    })
}

/// On a mesh the radius is in multiples of the local spacing, the mean distance to the particles that
/// share an edge, and two particles are neighbours if either reaches the other. A particle reaches
/// what lies within its radius and hangs together with it there by cells, so that no list spans a gap.
fn mesh_radius_lists(positions: &[[f64; 3]], radius: f64, mesh: &Mesh) -> Vec<Vec<u32>> {
    let distance = |a: u32, b: u32| {
        let (x, y) = (positions[a as usize], positions[b as usize]);
        (0..3).map(|c| (y[c] - x[c]).powi(2)).sum::<f64>().sqrt()
    };
    let mut lists = parallel::fill(positions.len(), |i| {
        let i = i as u32;
        let edges = mesh.neighbours(i, Sharing::Edge);
        let spacing = edges.iter().map(|b| distance(i, *b)).sum::<f64>() / edges.len() as f64;
        let reach = radius * spacing * (1.0 + 1e-9);
        let mut list = vec![i];
        let mut seen = HashSet::from([i]);
        let mut at = 0;
        while at < list.len() {
            for b in mesh.neighbours(list[at], Sharing::Cell) {
                if distance(i, b) <= reach && seen.insert(b) {
                    list.push(b);
                }
            }
            at += 1;
        }
        list.sort_unstable();
        list.retain(|b| *b != i);
        list
    });
    for a in 0..lists.len() {
        for k in 0..lists[a].len() {
            let b = lists[a][k] as usize;
            // What stands in a shorter list by now was put there by this loop, or was there.
            if let Err(place) = lists[b].binary_search(&(a as u32)) {
                lists[b].insert(place, a as u32);
            }
        }
    }
    lists
}
