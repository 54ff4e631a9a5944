//! What every geometry must satisfy: exact sums on the discrete body.

use super::*;

fn particles(geometry: &str) -> Particles {
    Particles::new(&scene(geometry)).unwrap_or_else(|e| panic!("{geometry}: {e}"))
}

fn scene(geometry: &str) -> Scene {
    let text = format!(
        r#"{{"geometry": {geometry},
            "material": {{"neo_hookean": {{"density": 1000, "youngs_modulus": 1e7, "poisson_ratio": 0.3}}}},
            "time": {{"end": 1}}}}"#
    );
    Scene::from_json(&text, &[]).unwrap_or_else(|e| panic!("{geometry}: {e}"))
}

/// Sum A N = 0, sum A N (x) X = (sum V) I, and for meshes closure and completeness of the mesh's own
/// operators; `volume` is that of the polyhedron.
fn check_identities(geometry: &str, volume: f64) -> Particles {
    let p = particles(geometry);
    let total: f64 = p.volumes.iter().sum();
    let length = volume.cbrt();
    let close = |what: &str, value: f64, unit: f64, tolerance: f64| {
        let residual = value.abs() / unit;
        println!("{geometry}: {what}: {residual:.1e} of {tolerance:.0e}");
        assert!(residual <= tolerance, "{geometry}: {what}: {residual:e}");
    };
    close("volume", total - volume, volume, 1e-12);
    assert!(p.volumes.iter().all(|v| *v > 0.0), "{geometry}");
    let mut sum = [0.0; 3];
    let mut moment = [[0.0; 3]; 3];
    for (x, an) in p.positions.iter().zip(&p.surface) {
        sum = add3(sum, *an);
        moment = add_outer(&moment, *an, *x);
    }
    for i in 0..3 {
        close("sum A N", sum[i], length * length, 1e-12);
        for j in 0..3 {
            let exact = if i == j { total } else { 0.0 };
            close("sum A N (x) X", moment[i][j] - exact, volume, 1e-11);
        }
    }
    // The faces together are the whole surface.
    let mut named = vec![[0.0; 3]; p.count()];
    for facet in p.patches.iter().flat_map(|patch| &patch.facets) {
        let an = &mut named[facet.particle as usize];
        *an = add3(*an, facet.area_vector);
        let length = dot(facet.normal, facet.normal).sqrt();
        assert!(
            (length - 1.0).abs() < 1e-14,
            "{geometry}: normal of length {length}"
        );
    }
    for (a, b) in named.iter().zip(&p.surface) {
        let rest = sub3(*a, *b);
        close("patches", dot(rest, rest).sqrt(), length * length, 1e-13);
    }
    // Orders are inverse to each other.
    for i in 0..p.count() {
        assert_eq!(p.rank[p.caller(i)] as usize, i, "{geometry}");
    }
    if let Shape::Mesh(mesh) = &p.shape {
        let mut closure = p.surface.clone();
        let mut complete = vec![[[0.0; 3]; 3]; p.count()];
        for cell in &mesh.cells {
            let c = Mesh::cell_operators(cell, &p.positions);
            for (i, &a) in cell.nodes().iter().enumerate() {
                for (j, &b) in cell.nodes().iter().enumerate() {
                    let (a, b) = (a as usize, b as usize);
                    let r = sub3(p.positions[b], p.positions[a]);
                    closure[a] = axpy3(closure[a], 0.5, sub3(c[i][j], c[j][i]));
                    complete[a] = add_outer(&complete[a], c[i][j], r);
                }
            }
        }
        for a in 0..p.count() {
            let scale = p.volumes[a].powf(2.0 / 3.0);
            close("closure", dot(closure[a], closure[a]).sqrt(), scale, 1e-10);
            for i in 0..3 {
                for j in 0..3 {
                    let exact = if i == j { 2.0 * p.volumes[a] } else { 0.0 };
                    close(
                        "completeness",
                        complete[a][i][j] - exact,
                        p.volumes[a],
                        1e-10,
                    );
                }
            }
        }
    }
    p
}

#[test]
fn boxes_satisfy_the_identities() {
    let box_with = |more: &str| {
        format!(r#"{{"box": {{"min": [0, 0, -1], "max": [1, 2, 0.5], "spacing": 0.25 {more}}}}}"#)
    };
    let lattice = check_identities(&box_with(""), 3.0);
    let jitter = r#", "jitter": {"fraction": 0.2, "seed": 7}"#;
    let moved = check_identities(&box_with(jitter), 3.0);
    check_identities(
        &box_with(r#", "grading": {"x": 5, "z": [0, 0.5, 0.6, 1]}"#),
        3.0,
    );
    let still = check_identities(&box_with(r#", "jitter": {"fraction": 0}"#), 3.0);
    // Without displacements the mesh is the lattice, in the same orders.
    assert_eq!(lattice.positions, still.positions);
    assert_eq!(lattice.order, still.order);
    assert_eq!(lattice.patches.len(), still.patches.len());
    let near = |x: f64, y: f64| (x - y).abs() < 1e-14;
    for (a, b) in lattice.patches.iter().zip(&still.patches) {
        assert_eq!(a.name, b.name);
        assert_eq!(a.facets.len(), b.facets.len());
        for (f, g) in a.facets.iter().zip(&b.facets) {
            assert_eq!(f.particle, g.particle);
            assert!(near(f.area, g.area) && (0..3).all(|c| near(f.normal[c], g.normal[c])));
        }
    }
    // Particles on the surface stay; the others move by up to a fifth of the spacing, and do.
    let mut largest: f64 = 0.0;
    for (i, (x, y)) in lattice.positions.iter().zip(&moved.positions).enumerate() {
        let way = (0..3).map(|c| (x[c] - y[c]).abs()).fold(0.0, f64::max);
        if lattice.surface[i] != [0.0; 3] {
            assert_eq!(way, 0.0);
        }
        largest = largest.max(way);
    }
    assert!((0.04..=0.05).contains(&largest), "{largest}");
}
