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

/// Area of the polygon that stands for a sector of the unit disc.
fn polygon(angle: f64, segments: usize) -> f64 {
    0.5 * segments as f64 * (angle / segments as f64).sin()
}

const RIGHT: f64 = std::f64::consts::FRAC_PI_2;

#[test]
fn cylinders_satisfy_the_identities() {
    let cylinder = |more: &str| {
        format!(
            r#"{{"cylinder": {{"base": [1, -2, 3], "radius": 0.5, "length": 2, "layers": 4, {more}}}}}"#
        )
    };
    for (more, angle, segments, section) in [
        (r#""divisions": 1"#, 4.0 * RIGHT, 8, 17),
        (r#""divisions": 3, "axis": "x""#, 4.0 * RIGHT, 24, 121),
        (
            r#""divisions": 2, "sector": "half", "axis": "y""#,
            2.0 * RIGHT,
            8,
            33,
        ),
        (
            r#""divisions": 3, "sector": "quarter", "grading": 0.2"#,
            RIGHT,
            6,
            37,
        ),
        (
            r#""divisions": 4, "sector": "quarter", "radial_grading": 0.5"#,
            RIGHT,
            8,
            61,
        ),
        (
            r#""divisions": 6, "sector": {"wedge": 11.25}"#,
            RIGHT / 8.0,
            1,
            13,
        ),
        (
            r#""divisions": 5, "sector": {"wedge": 120}"#,
            RIGHT / 0.75,
            10,
            36,
        ),
    ] {
        let volume = 2.0 * 0.25 * polygon(angle, segments);
        let p = check_identities(&cylinder(more), volume);
        assert_eq!(p.count(), 5 * section, "{more}");
        // The caller's order is section by section, the body's is line by line along the axis.
        assert_eq!(p.caller(1), section, "{more}");
        let facets = |name: &str| &p.patches.iter().find(|q| q.name == name).unwrap().facets;
        let area = |name: &str| facets(name).iter().map(|f| f.area).sum::<f64>();
        let near = |x: f64, y: f64| assert!((x - y).abs() < 1e-13, "{more}: {x} for {y}");
        near(area("top"), volume / 2.0);
        near(area("bottom"), volume / 2.0);
        let chord = (angle / segments as f64 / 2.0).sin();
        near(area("side"), 2.0 * segments as f64 * chord);
        if angle < 4.0 * RIGHT {
            near(area("start"), 1.0);
            near(area("end"), 1.0);
            // Planes through the axis: one exact normal each.
            for name in ["start", "end"] {
                let normal = facets(name)[0].normal;
                for f in facets(name) {
                    let rest = sub3(f.normal, normal);
                    assert!(dot(rest, rest).sqrt() < 1e-12, "{more}: {name}");
                }
            }
        }
        // One normal for each particle of the side, outward.
        let middle = [1.0, -2.0, 3.0];
        for pair in facets("side").windows(2) {
            assert!(pair[0].particle < pair[1].particle, "{more}: two normals");
        }
        for f in facets("side") {
            let out = sub3(p.positions[f.particle as usize], middle);
            assert!(dot(out, f.normal) > 0.4, "{more}: {:?}", f.normal);
        }
    }
    // The copper bar of [URL22] 8.3.
    for (divisions, layers, count) in [(3, 41, 1554), (4, 60, 3721), (5, 79, 7280)] {
        let more = format!(r#""divisions": {divisions}, "sector": "quarter""#);
        let text = cylinder(&more).replace(r#""layers": 4"#, &format!(r#""layers": {layers}"#));
        assert_eq!(particles(&text).count(), count);
    }
}

#[test]
fn a_taper_changes_the_radius_along_the_axis() {
    let text = r#"{"cylinder": {"radius": 2, "length": 3, "divisions": 2, "layers": 6,
        "sector": "quarter", "taper": [[0, 0.5], [0.5, 1], [1, 1]]}}"#;
    let frustum = |f: f64, g: f64| (f * f + f * g + g * g) / 3.0;
    let volume = 4.0 * polygon(RIGHT, 4) * (1.5 * frustum(0.5, 1.0) + 1.5);
    let p = check_identities(text, volume);
    let radius = |z: f64| {
        let at = p.positions.iter().filter(|x| (x[2] - z).abs() < 1e-12);
        at.map(|x| x[0].hypot(x[1])).fold(0.0, f64::max)
    };
    for (z, r) in [(0.0, 1.0), (0.5, 4.0 / 3.0), (1.5, 2.0), (3.0, 2.0)] {
        assert!((radius(z) - r).abs() < 1e-14, "{z}: {}", radius(z));
    }
}

#[test]
fn the_punch_block_has_the_particles_of_the_paper() {
    // [URL23] 7.4, M1: 22,420 particles.
    let text = r#"{"perforated_box": {"min": [-0.5, -0.5, 0], "max": [0.5, 0.5, 0.5],
        "tiles": [3, 3], "diameter": 0.2, "divisions": 9, "rings": 3, "layers": 18}}"#;
    let p = particles(text);
    assert_eq!(p.count(), 22_420);
    let hole = 0.01 * polygon(4.0 * RIGHT, 36);
    let total: f64 = p.volumes.iter().sum();
    assert!((total - 0.5 * (1.0 - 9.0 * hole)).abs() < 1e-13, "{total}");
    let names: Vec<&str> = p.patches.iter().map(|q| q.name.as_str()).collect();
    assert_eq!(
        names,
        [
            "holes", "x_max", "x_min", "y_max", "y_min", "z_max", "z_min"
        ]
    );

    let small = r#"{"perforated_box": {"min": [0, 0, 0], "max": [2, 6, 4], "along": "y",
        "tiles": [2, 1], "diameter": 1, "solid": [[1, 0]], "divisions": 2, "rings": 1, "layers": 2,
        "grading": 2}}"#;
    // Across Y come Z and X: two tiles along Z, the second without a hole.
    let p = check_identities(small, 6.0 * (8.0 - 0.25 * polygon(4.0 * RIGHT, 8)));
    let holes = &p.patches[0];
    assert_eq!(holes.name, "holes");
    for f in &holes.facets {
        let x = p.positions[f.particle as usize];
        assert!((x[2] - 1.0).hypot(x[0] - 1.0) - 0.5 < 1e-14, "{x:?}");
        // Towards the axis of the hole.
        assert!(
            f.normal[0] * (1.0 - x[0]) + f.normal[2] * (1.0 - x[2]) > 0.45,
            "{x:?}"
        );
    }
}

#[test]
fn a_mesh_reads_a_linear_field_exactly() {
    let bodies = [
        r#"{"cylinder": {"radius": 1, "length": 2, "divisions": 2, "layers": 3}}"#,
        r#"{"cylinder": {"radius": 1, "length": 2, "divisions": 3, "layers": 3, "sector": {"wedge": 50}}}"#,
        r#"{"box": {"min": [0, 0, 0], "max": [1, 1, 2], "spacing": 0.25, "jitter": {"fraction": 0.3}}}"#,
    ];
    let field = |x: [f64; 3]| 1.0 + 2.0 * x[0] - 3.0 * x[1] + 0.5 * x[2];
    for body in bodies {
        let p = particles(body);
        for i in 0..60 {
            // A walk through the sector, inside every body.
            let phi = f64::from(i) * 0.01;
            let r = 0.015 * f64::from(i);
            let x = [
                0.05 + r * phi.cos(),
                r * phi.sin() + 0.01,
                f64::from(i) / 30.0,
            ];
            let weights = p
                .interpolation(x)
                .unwrap_or_else(|| panic!("{body}: {x:?} is outside"));
            let value: f64 = weights
                .iter()
                .map(|(n, w)| w * field(p.positions[*n as usize]))
                .sum();
            let residual = (value - field(x)).abs();
            println!("{residual:.1e} of 1e-12");
            assert!(residual < 1e-12, "{body}: {x:?}: {residual}");
            assert!(weights.iter().all(|(_, w)| *w > 0.0));
        }
        // A particle reads itself, with coordinates as rounded as a text has them.
        for (n, x) in p.positions.iter().enumerate() {
            let rounded = x.map(|c| (c * 1e9).round() / 1e9);
            assert_eq!(
                p.interpolation(rounded),
                Some(vec![(n as u32, 1.0)]),
                "{body}: {x:?}"
            );
        }
        for x in [
            [1.1, 0.0, 1.0],
            [0.2, 0.1, -0.01],
            [0.0, 0.0, 2.1],
            [1e9; 3],
            [f64::NAN; 3],
        ] {
            assert_eq!(p.interpolation(x), None, "{body}: {x:?}");
        }
    }
}

/// Writes a grid as Gmsh does; node i has the tag 10 + 3 i, cell i the tag 100 + i.
fn write_msh(grid: &mesh::Grid, modern: bool, binary: bool, swapped: bool) -> Vec<u8> {
    struct Out {
        bytes: Vec<u8>,
        binary: bool,
        swapped: bool,
    }
    impl Out {
        fn number(&mut self, text: String, mut raw: Vec<u8>) {
            if self.binary {
                if self.swapped {
                    raw.reverse();
                }
                self.bytes.extend(raw);
            } else {
                self.bytes.extend(text.bytes());
                self.bytes.push(b' ');
            }
        }
        fn int(&mut self, v: i32) {
            self.number(v.to_string(), v.to_ne_bytes().into());
        }
        fn size(&mut self, v: usize) {
            self.number(v.to_string(), (v as u64).to_ne_bytes().into());
        }
        fn real(&mut self, v: f64) {
            self.number(format!("{v:?}"), v.to_ne_bytes().into());
        }
        fn text(&mut self, text: &str) {
            self.bytes.extend(text.bytes());
        }
        fn end_line(&mut self) {
            if !self.binary {
                self.text("\n");
            }
        }
    }
    let mut o = Out {
        bytes: Vec::new(),
        binary,
        swapped,
    };
    let version = if modern { "4.1" } else { "2.2" };
    o.text(&format!("$MeshFormat\n{version} {} 8\n", i32::from(binary)));
    if binary {
        o.int(1);
        o.text("\n");
    }
    o.text("$EndMeshFormat\n$PhysicalNames\n");
    o.text(&format!("{}\n", grid.names.len() + 1));
    for (i, name) in grid.names.iter().enumerate() {
        o.text(&format!("2 {} \"{name}\"\n", i + 1));
    }
    o.text("3 1 \"body\"\n$EndPhysicalNames\n");
    if modern {
        o.text("$Entities\n");
        for count in [0, 0, grid.names.len(), 1] {
            o.size(count);
        }
        for i in 0..=grid.names.len() {
            o.end_line();
            let tag = if i < grid.names.len() { i + 1 } else { 1 } as i32;
            o.int(tag);
            for _ in 0..6 {
                o.real(0.0);
            }
            o.size(1);
            o.int(tag);
            o.size(0);
        }
        o.text("\n$EndEntities\n");
    }
    let node_tag = |n: u32| 10 + 3 * n as usize;
    let count = grid.nodes.len();
    if modern {
        o.text("$Nodes\n");
        for v in [1, count, 10, 10 + 3 * count] {
            o.size(v);
        }
        o.end_line();
        for v in [3, 1, 0] {
            o.int(v);
        }
        o.size(count);
        o.end_line();
        for n in 0..count as u32 {
            o.size(node_tag(n));
            o.end_line();
        }
        for x in &grid.nodes {
            x.iter().for_each(|c| o.real(*c));
            o.end_line();
        }
    } else {
        o.text(&format!("$Nodes\n{count}\n"));
        for (n, x) in grid.nodes.iter().enumerate() {
            o.int(node_tag(n as u32) as i32);
            x.iter().for_each(|c| o.real(*c));
            o.end_line();
        }
    }
    o.text("\n$EndNodes\n$Elements\n");
    // (dimension, entity, type, tag, nodes)
    let surfaces = grid.named.iter().enumerate().map(|(i, (corners, name))| {
        let nodes: Vec<u32> = corners.iter().copied().filter(|n| *n != NONE).collect();
        (
            2,
            *name as i32 + 1,
            nodes.len() as i32 - 1,
            10_000 + i,
            nodes,
        )
    });
    let cells = grid.cells.iter().enumerate().map(|(i, c)| {
        let number = match c.kind {
            mesh::CellKind::Tetrahedron => 4,
            mesh::CellKind::Hexahedron => 5,
            mesh::CellKind::Prism => 6,
        };
        (3, 1, number, 100 + i, c.nodes().to_vec())
    });
    let all: Vec<_> = surfaces.chain(cells).collect();
    if modern {
        for v in [all.len(), all.len(), 100, 10_000] {
            o.size(v);
        }
    } else {
        o.text(&format!("{}\n", all.len()));
    }
    for (dimension, entity, number, tag, nodes) in all {
        o.end_line();
        if modern {
            for v in [dimension, entity, number] {
                o.int(v);
            }
            o.size(1);
            o.end_line();
            o.size(tag);
            nodes.iter().for_each(|n| o.size(node_tag(*n)));
        } else {
            let header = if binary {
                [number, 1, 2, tag as i32]
            } else {
                [tag as i32, number, 2, entity]
            };
            header.into_iter().for_each(|v| o.int(v));
            if binary {
                o.int(entity);
            }
            o.int(entity);
            nodes.iter().for_each(|n| o.int(node_tag(*n) as i32));
        }
    }
    o.text("\n$EndElements\n");
    o.bytes
}

fn small_grid() -> mesh::Grid {
    let text = r#"{"cylinder": {"radius": 1, "length": 2, "divisions": 2, "layers": 2,
        "sector": {"wedge": 50}, "axis": "x"}}"#;
    let Geometry::Cylinder(c) = scene(text).geometry else {
        panic!("a cylinder");
    };
    structured::cylinder(&c)
}

#[test]
fn every_kind_of_mesh_file_gives_the_same_mesh() {
    let grid = small_grid();
    for (modern, binary, swapped) in [
        (false, false, false),
        (true, false, false),
        (false, true, false),
        (true, true, false),
        (false, true, true),
        (true, true, true),
    ] {
        let case = format!("4.1: {modern}, binary: {binary}, swapped: {swapped}");
        let bytes = write_msh(&grid, modern, binary, swapped);
        let mesh = MeshFile::read(&bytes, 2.0).unwrap_or_else(|e| panic!("{case}: {e}"));
        let doubled: Vec<_> = grid.nodes.iter().map(|x| scale3(2.0, *x)).collect();
        assert_eq!(mesh.nodes, doubled, "{case}");
        assert_eq!(mesh.cells, grid.cells, "{case}");
        assert_eq!(mesh.notes().len(), 0, "{case}");
        let by_name = |names: &[String], named: &[([u32; 4], u32)]| {
            let mut all: Vec<_> = named
                .iter()
                .map(|(f, n)| (names[*n as usize].clone(), *f))
                .collect();
            all.sort();
            all
        };
        assert_eq!(
            by_name(&mesh.names, &mesh.named),
            by_name(&grid.names, &grid.named),
            "{case}"
        );
    }
}

#[test]
fn damaged_mesh_files_are_errors() {
    let grid = small_grid();
    let mut state = 1u64;
    let mut random = |below: usize| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (state >> 33) as usize % below
    };
    let (mut refused, mut read) = (0, 0);
    for (modern, binary) in [(false, false), (true, false), (false, true), (true, true)] {
        let whole = write_msh(&grid, modern, binary, false);
        for _ in 0..1500 {
            let mut bytes = whole.clone();
            for _ in 0..=random(3) {
                let at = random(bytes.len());
                match random(5) {
                    0 => bytes.truncate(at.max(1)),
                    1 => bytes[at] = random(256) as u8,
                    2 => bytes[at] = b"0123456789.-+e$ \n\"\xff"[random(19)],
                    3 => drop(bytes.remove(at)),
                    _ => {
                        let end = (at + 1 + random(40)).min(bytes.len());
                        let piece = bytes[at..end].to_vec();
                        let to = random(bytes.len());
                        drop(bytes.splice(to..to, piece));
                    }
                }
            }
            match MeshFile::read(&bytes, 1.0) {
                Ok(mesh) => {
                    read += 1;
                    let _ = Particles::of_grid(mesh::Grid::from(&mesh), &BTreeMap::new());
                }
                Err(e) => {
                    refused += 1;
                    let text = e.message();
                    assert!(
                        text.starts_with("line ") || text.starts_with("byte "),
                        "{text}"
                    );
                }
            }
        }
    }
    println!("{refused} refused, {read} read");
    assert!(refused > 3000 && read > 300);
}
