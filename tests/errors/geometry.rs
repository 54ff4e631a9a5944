//! Geometry: shapes, lattices, patches, the graph of neighbours; and more than the memory holds.

use urlsph::Code::{InvalidScene as S, OutOfMemory as M};
use urlsph::scene::{Geometry, MeshGeometry};

use crate::catalogue::{Entry, entry};

const CYLINDER: &str = r#"geometry={"cylinder": {"radius": 1, "length": 2, "divisions": 2, "layers": 4,
    "sector": "full"}}"#;
const PERFORATED: &str = r#"geometry={"perforated_box": {"min": [0, 0, 0], "max": [2, 1, 1], "tiles": [2, 1],
    "diameter": 0.5, "divisions": 2, "rings": 1, "layers": 2, "solid": []}}"#;

/// Nodes of one cell at very different distances.
const SPREAD: &str = r#"geometry={"box": {"min": [0, 0, 0], "max": [1, 1, 1], "spacing": 0.5,
    "jitter": {"fraction": 0.4}}}"#;

pub fn entries() -> Vec<Entry> {
    [shapes(), patches(), particles(), sizes()]
        .into_iter()
        .flatten()
        .collect()
}

fn shapes() -> Vec<Entry> {
    vec![
        entry(
            S,
            "path",
            "a body needs at least one box",
            "The union of boxes is empty.",
            "Add a box.",
        )
        .scene(&[r#"geometry={"boxes": {}}"#], "geometry.boxes"),
        entry(
            S,
            "path",
            "a union of boxes is one lattice: only a single box (geometry.box) takes this; for other shapes use a mesh",
            "Graded or jittered boxes do not share the nodes of their faces.",
            "Leave it out, or mesh the body with Gmsh.",
        )
        .scene(
            &[
                crate::TWO_BOXES,
                r#"geometry.boxes.a.jitter={"fraction": 0.1}"#,
            ],
            "geometry.boxes.a.jitter",
        ),
        entry(
            S,
            "path",
            "expected at least 1 instead of 0",
            "A number of divisions, layers, rings or tiles is 0.",
            "Give 1 or more.",
        )
        .scene(
            &[CYLINDER, "geometry.cylinder.layers=0"],
            "geometry.cylinder.layers",
        ),
        entry(
            S,
            "path",
            "expected an angle of 0.1 degrees or more and less than 180 instead of <angle>",
            "A wedge of this angle is flat, or none.",
            "Give degrees in that range; from 180 on take `half` or `full`.",
        )
        .scene(
            &[CYLINDER, r#"geometry.cylinder.sector={"wedge": 180}"#],
            "geometry.cylinder.sector.wedge",
        ),
        entry(
            S,
            "path",
            "expected <rule> instead of <place>",
            "The places of a taper go from 0 to 1, upwards.",
            "Begin with 0, end with 1 and sort what is between.",
        )
        .variants(&["0 for the bottom", "1 for the top", "more than the place before"])
        .scene(
            &[CYLINDER, "geometry.cylinder.taper=[[0.5, 1], [1, 1]]"],
            "geometry.cylinder.taper[0][0]",
        )
        .scene(
            &[CYLINDER, "geometry.cylinder.taper=[[0, 1], [2, 1]]"],
            "geometry.cylinder.taper[1][0]",
        )
        .scene(
            &[CYLINDER, "geometry.cylinder.taper=[[0, 1], [0, 1], [1, 1]]"],
            "geometry.cylinder.taper[1][0]",
        ),
        entry(
            S,
            "path",
            "expected at least two entries, at 0 and at 1",
            "One entry makes no taper.",
            "Add the other end, or leave the taper out.",
        )
        .scene(
            &[CYLINDER, "geometry.cylinder.taper=[[0, 1]]"],
            "geometry.cylinder.taper",
        ),
        entry(
            S,
            "path",
            "the fractions make <count> divisions, not <count>",
            "The list of fractions and the number of divisions disagree.",
            "Give one fraction more than there are divisions.",
        )
        .scene(
            &[CYLINDER, "geometry.cylinder.grading=[0, 1]"],
            "geometry.cylinder.grading",
        ),
        entry(
            S,
            "path",
            "expected a ratio from 0.001 to 1000 instead of <ratio>",
            "The cells of one end would be too unlike those of the other.",
            "Give a ratio nearer to 1.",
        )
        .scene(
            &[CYLINDER, "geometry.cylinder.grading=1e4"],
            "geometry.cylinder.grading",
        ),
        entry(
            S,
            "path",
            "expected fractions of the length that begin with 0 and end with 1",
            "The fractions do not divide the whole length.",
            "Begin with 0 and end with 1.",
        )
        .scene(
            &[CYLINDER, "geometry.cylinder.grading=[0, 0.5, 0.9]"],
            "geometry.cylinder.grading",
        ),
        entry(
            S,
            "path",
            "expected more than the fraction before, <fraction>, instead of <fraction>",
            "Fractions are out of order or there twice.",
            "Sort them.",
        )
        .scene(
            &[CYLINDER, "geometry.cylinder.radial_grading=[0, 0, 1]"],
            "geometry.cylinder.radial_grading[1]",
        ),
        entry(
            S,
            "path",
            "expected more than min[<axis>] = <coordinate> instead of <coordinate>",
            "The box has no extent along an axis, or its corners are swapped.",
            "Give a larger `max`.",
        )
        .scene(&["geometry.box.max[1]=0"], "geometry.box.max[1]")
        .scene(
            &[PERFORATED, "geometry.perforated_box.max[1]=0"],
            "geometry.perforated_box.max[1]",
        ),
        entry(
            S,
            "path",
            "expected less than the tiles' width <width> along <axis> instead of <diameter>",
            "The holes are as wide as the tiles, and touch each other.",
            "Make the holes smaller or the tiles fewer.",
        )
        .scene(
            &[PERFORATED, "geometry.perforated_box.diameter=1"],
            "geometry.perforated_box.diameter",
        ),
        entry(
            S,
            "path",
            "there is no tile <tile>: there are <count> by <count>, counted from 0",
            "A tile without a hole is named that is not there.",
            "Give two indices below these numbers.",
        )
        .scene(
            &[PERFORATED, "geometry.perforated_box.solid=[[2, 0]]"],
            "geometry.perforated_box.solid[0]",
        ),
        entry(
            S,
            "path",
            "this tile is listed twice: remove one",
            "A tile without a hole is listed twice.",
            "Remove one of the two.",
        )
        .scene(
            &[PERFORATED, "geometry.perforated_box.solid=[[1, 0], [1, 0]]"],
            "geometry.perforated_box.solid[1]",
        ),
        entry(
            S,
            "path",
            "expected 0 or more and less than 0.5 instead of <fraction>: beyond it cells invert",
            "Nodes would be moved past their neighbours.",
            "Give a smaller fraction.",
        )
        .scene(
            &[r#"geometry.box.jitter={"fraction": 0.5}"#],
            "geometry.box.jitter.fraction",
        ),
        entry(
            S,
            "path",
            "the spacing <spacing> is larger than the edge <edge> along <axis>; each edge needs at least one cell",
            "Not one cell fits into the box.",
            "Choose a smaller spacing, or one per axis.",
        )
        .scene(&["geometry.box.spacing=2"], "geometry.box.spacing"),
        entry(
            S,
            "path",
            "the file is not loaded: a mesh that is put into a scene in code needs `load` first",
            "A scene made in code names a mesh file that nobody has read.",
            "Call `MeshGeometry::load`.",
        )
        .call("a mesh that was not read", || {
            let mut scene = crate::scene();
            scene.geometry = Geometry::Mesh(MeshGeometry::new("body.msh", 1.0));
            scene.validate()
        }),
    ]
}

fn patches() -> Vec<Entry> {
    vec![
        entry(
            S,
            "path",
            "a patch needs at least one face",
            "The list of faces is empty.",
            "Name the faces that the patch is cut from.",
        )
        .scene(&["patches.side.faces=[]"], "patches.side.faces"),
        entry(
            S,
            "path",
            "there is no face `<name>`; there are <faces>",
            "The geometry has no face of this name.",
            "Use a name of the list.",
        )
        .scene(&[r#"patches.side.faces=["left"]"#], "patches.side.faces[0]"),
        entry(
            S,
            "path",
            "the face `<name>` is listed twice: remove one",
            "A patch has each face once.",
            "Remove one of the two.",
        )
        .scene(
            &[r#"patches.side.faces=["x_min", "x_min"]"#],
            "patches.side.faces[1]",
        ),
        entry(
            S,
            "path",
            "expected at least min[<axis>] = <coordinate> instead of <coordinate>",
            "The corners of the region that cuts a patch are swapped.",
            "Give a larger `max`.",
        )
        .scene(
            &[r#"patches.side={"faces": ["x_min"], "min": [0, 1, 0], "max": [0, 0, 0]}"#],
            "patches.side.max[1]",
        ),
        entry(
            S,
            "path",
            "the body has no exposed face `<name>`; it has <faces>",
            "Another box covers the face.",
            "Use an exposed face.",
        )
        .scene(
            &[crate::TWO_BOXES, r#"patches.joint.faces=["a.x_max"]"#],
            "patches.joint.faces",
        ),
        entry(
            S,
            "path boundary",
            "selects no particle: the centres of the cell faces must lie in [min, max]",
            "The region that cuts the patch meets no face of a cell.",
            "Widen it by half a cell.",
        )
        .scene(
            &[r#"patches.spot={"faces": ["y_max"], "min": [5, 0, 0]}"#],
            "patches.spot",
        ),
    ]
}

fn particles() -> Vec<Entry> {
    vec![
        entry(
            S,
            "path",
            "along <axis> the spacing jumps from <spacing> m to <spacing> m at <place> m: give the boxes bounds and \
             spacings that fit one lattice",
            "Boxes with different spacings share one lattice; where it jumps a uniform stress would push particles.",
            "Give the boxes the same spacing and bounds that are multiples of it.",
        )
        .scene(
            &[
                crate::TWO_BOXES,
                "geometry.boxes.a.spacing=0.5",
                "geometry.boxes.b.spacing=[0.2, 0.5, 0.5]",
            ],
            "geometry.boxes",
        ),
        entry(
            S,
            "path",
            "cell <cell> at (<x>, <y>, <z>) m is inverted or flat: use less jitter, or more even divisions",
            "A cell of the geometry has no volume.",
            "Use less jitter, milder gradings, or more even numbers of divisions.",
        )
        .call("a needle of a cylinder", || {
            let mut scene = crate::scene();
            if let Geometry::Box(b) = &mut scene.geometry {
                b.jitter = serde_json::from_str(r#"{"fraction": 0.49}"#).ok();
                b.spacing = urlsph::scene::Spacing::Uniform(0.125);
            }
            urlsph::Simulation::with_threads(scene, 1)
        }),
        entry(
            S,
            "path particle position",
            "a particle has no neighbours: widen the radius or refine the spacing",
            "The radius reaches no other particle from the one that is named.",
            "Widen `numerics.neighbours.radius`.",
        )
        .untested(
            "A radius above one spacing, or one mean edge of a mesh, always reaches the nearest neighbour: this is the \
             second line of defence.",
        ),
        entry(
            S,
            "path particle position",
            "the body falls into parts that are not connected: let boxes share a face and the parts of a mesh their \
             nodes, or make a scene of each part",
            "The particle that is named cannot be reached from the first one.",
            "Close the gap, or run the parts as scenes of their own.",
        )
        .scene(
            &[r#"geometry={"boxes": {"a": {"min": [0,0,0], "max": [1,1,1], "spacing": 0.5},
                "b": {"min": [3,0,0], "max": [4,1,1], "spacing": 0.5}}}"#],
            "geometry",
        ),
        entry(
            S,
            "path particle position",
            "the neighbours of a particle lie in a plane or on a line, so no gradient can be formed: widen <key>",
            "The particle that is named has too few neighbours around it.",
            "Choose more neighbours, or a wider radius.",
        )
        .variants(&[
            "the neighbours of a particle lie in a plane or on a line, so no gradient can be formed: widen the radius",
            "the neighbours of a particle lie in a plane or on a line, so no gradient can be formed: widen \
             numerics.neighbours",
        ])
        .scene(
            &[SPREAD, r#"numerics={"operators": "kernel", "neighbours": {"radius": 1.1}}"#],
            "numerics.neighbours",
        )
        .scene(
            &[SPREAD, r#"numerics={"operators": "repaired", "neighbours": {"radius": 1.1}}"#],
            "geometry",
        ),
        entry(
            S,
            "path",
            "the particles form a lattice, not a mesh: leave this out, or give the box a jitter of 0",
            "A lattice has no shape functions.",
            "Leave `operators` out, or give the box a jitter of 0.",
        )
        .scene(&["numerics.operators=mesh"], "numerics.operators"),
        entry(
            S,
            "path particle position",
            "the operators of the mesh need all particles that share a cell as neighbours: set 26",
            "Particles of one cell are not neighbours.",
            "Set `numerics.neighbours` to 26.",
        )
        .scene(
            &[CYLINDER, r#"numerics={"operators": "mesh", "neighbours": 6}"#],
            "numerics.neighbours",
        ),
        entry(
            S,
            "path",
            "the surface of the body does not close: its areas and its volumes disagree by <share> of an area, at most \
             <share> is round-off; mesh the body again",
            "The faces of the cells do not enclose them.",
            "Mesh the body again; report a body of the library's own shapes for which this appears.",
        )
        .unit("src/reference/repair.rs", "a_surface_that_does_not_close_is_an_error"),
        entry(
            S,
            "path particle position",
            "the operators cannot be repaired: after <count> iterations a uniform stress still pushes this particle \
             with <share> of its area. Give it more neighbours (numerics.neighbours), or use numerics.operators \"mesh\"",
            "The particle that is named has too few neighbours, or they are all on one side.",
            "Choose more neighbours, or the operators of the mesh.",
        )
        .scene(
            &[
                CYLINDER,
                r#"geometry.cylinder.sector={"wedge": 0.1}"#,
                "numerics.neighbours=6",
            ],
            "geometry",
        ),
    ]
}

fn sizes() -> Vec<Entry> {
    vec![
        entry(
            M,
            "path",
            "this makes about <count> particles, which with their neighbours need about <size> GB; <limit>; choose a \
             larger spacing or fewer neighbours",
            "The scene is too fine for this machine, or for numbers of particles at all.",
            "Choose larger cells: half as many per direction need an eighth of the memory.",
        )
        .variants(&["at most <count> particles are possible", "<size> GB are available"])
        .scene(&["geometry.box.spacing=1e-4"], "geometry.box.spacing")
        .call("much less than the limit", || {
            let overrides = ["geometry.box.spacing=1.1e-3".to_owned()];
            urlsph::Scene::from_json(crate::common::BLOCK, &overrides)
        }),
        entry(
            M,
            "path",
            "the lattice has <count> nodes, at most 2.1e9 are possible: choose a larger spacing",
            "Long thin boxes span one lattice, most of which is empty.",
            "Choose a larger spacing, or make a scene of each part.",
        )
        .scene(
            &[r#"geometry={"boxes": {"a": {"min": [0,0,0], "max": [1500,1,1], "spacing": 1},
                "b": {"min": [0,0,0], "max": [1,1500,1], "spacing": 1},
                "c": {"min": [0,0,0], "max": [1,1,1500], "spacing": 1}}}"#],
            "geometry",
        ),
        entry(
            M,
            "path",
            "the mesh has <count> nodes and <count> cells, at most 2.1e9 are possible: coarsen it",
            "Particles are counted in 32 bits.",
            "Coarsen the mesh.",
        )
        .untested("Such a mesh takes more than 100 GB of memory; what the scene foresees refuses it before."),
    ]
}
