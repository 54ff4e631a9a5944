//! Files of meshes: each error names the line (text) or the byte (binary).

use urlsph::Code::{Io as I, Parse as P};
use urlsph::scene::MeshGeometry;

use crate::catalogue::{Entry, entry};

/// A tetrahedron and another one on top, as version 2.2.
const TWO: &str = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n2 7 \"the skin\"\n\
    $EndPhysicalNames\n$Nodes\n6\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n5 1 1 1\n6 9 9 9\n$EndNodes\n\
    $Elements\n4\n1 15 2 0 1 6\n2 2 2 7 1 1 3 2\n3 4 2 1 1 1 2 3 4\n4 4 2 1 1 2 3 4 5\n$EndElements\n";
/// A tetrahedron as version 4.1.
const ONE: &str = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 4 1 4\n3 1 0 4\n1\n2\n3\n4\n0 0 0\n\
    1 0 0\n0 1 0\n0 0 1\n$EndNodes\n$Elements\n1 1 1 1\n3 1 4 1\n1 1 2 3 4\n$EndElements\n";

const AGAIN: &str =
    "Save the mesh again with Gmsh (4.1 or 2.2, text or binary), or copy the whole file again.";

fn wrong(text: &str, cause: &'static str, remedy: &'static str) -> Entry {
    entry(P, "path", format!("<line or byte>: {text}"), cause, remedy)
}

/// One piece of a good file replaced.
fn changed(good: &str, from: &str, to: &str) -> String {
    assert!(good.contains(from), "{from}");
    good.replacen(from, to, 1)
}

impl Entry {
    fn two(self, from: &str, to: &str) -> Self {
        self.mesh(to, changed(TWO, from, to))
    }
    fn one(self, from: &str, to: &str) -> Self {
        self.mesh(to, changed(ONE, from, to))
    }
}

pub fn entries() -> Vec<Entry> {
    [files(), format(), numbers(), body()]
        .into_iter()
        .flatten()
        .collect()
}

fn files() -> Vec<Entry> {
    vec![
        entry(
            I,
            "path",
            "the mesh <file> cannot be read: <reason>",
            "The file is not there or not to be read; a relative path counts from the folder of the scene.",
            "Correct the path or the permissions.",
        )
        .variants(&["it is <what>", "a folder", "a device or a pipe", "it is larger than 4 GiB"])
        .scene(&[r#"geometry={"mesh": {"file": "none.msh"}}"#], "geometry.mesh.file")
        .scene(&[r#"geometry={"mesh": {"file": "."}}"#], "geometry.mesh.file")
        .call("a device", || MeshGeometry::new("/dev/null", 1.0).load("".as_ref()))
        .call("an endless file", || {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("long.msh");
            // It takes no room on the disk.
            let file = std::fs::File::create(&path).unwrap();
            file.set_len((4 << 30) + 1).unwrap();
            MeshGeometry::new("long.msh", 1.0).load(folder.path())
        }),
        entry(
            I,
            "path",
            "the mesh <file> has changed since it was read: read the scene again",
            "A scene is packed with its mesh, and the file is another one by now.",
            "Read the scene again and pack that.",
        )
        .call("another mesh in its place", || {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("body.msh");
            std::fs::write(&path, TWO).unwrap();
            let mut scene = crate::scene();
            let mut mesh = MeshGeometry::new("body.msh", 1.0);
            mesh.load(folder.path()).unwrap();
            scene.geometry = urlsph::scene::Geometry::Mesh(mesh);
            std::fs::write(&path, ONE).unwrap();
            scene.packed()
        }),
    ]
}

fn format() -> Vec<Entry> {
    vec![
        wrong(
            "this is no Gmsh mesh: it does not begin with $MeshFormat",
            "The file is of another format.",
            "Save it as Gmsh's .msh.",
        )
        .two("$MeshFormat\n", "hello\n"),
        wrong(
            "version <version> is not supported: save the mesh as version 4.1 or 2.2 (Mesh.MshFileVersion)",
            "Gmsh has written another version of its format.",
            "Set Mesh.MshFileVersion to 4.1 or 2.2 and save again.",
        )
        .two("2.2 0 8", "4.0 0 8"),
        wrong(
            "numbers of <size> bytes are not supported, only of 8: save the mesh as version 4.1 or 2.2 \
             (Mesh.MshFileVersion)",
            "The file has numbers of another size.",
            AGAIN,
        )
        .two("2.2 0 8", "2.2 0 4"),
        wrong(
            "expected the file type 0 (text) or 1 (binary) instead of <type>: save the mesh as version 4.1 or 2.2 \
             (Mesh.MshFileVersion)",
            "The head of the file is damaged.",
            AGAIN,
        )
        .two("2.2 0 8", "2.2 3 8"),
        wrong(
            "the mark of the byte order is damaged: save the mesh again",
            "The file says that it is binary, and its first number is not 1.",
            AGAIN,
        )
        .mesh("a wrong mark", b"$MeshFormat\n4.1 1 8\n\x07\0\0\0\n$EndMeshFormat\n"),
        wrong(
            "$MeshFormat does not end with $EndMeshFormat: save the mesh again",
            "The head of the file is damaged.",
            AGAIN,
        )
        .two("$EndMeshFormat\n", ""),
        wrong(
            "the file ends in the middle, it is truncated: save or copy it again",
            "The file was not written or copied to its end.",
            AGAIN,
        )
        .two("$EndElements\n", ""),
        wrong(
            "expected the beginning of a section, such as $Nodes, instead of `<text>`",
            "Between two sections there is something else.",
            AGAIN,
        )
        .two("$EndElements\n", "$EndElements\nrest\n"),
        wrong(
            "the mesh is partitioned: save it without partitions",
            "The mesh was divided for parallel computations.",
            "Save it without partitions (Mesh.PartitionCreateTopology and others are off).",
        )
        .two("$Nodes\n", "$PartitionedEntities\n0\n$EndPartitionedEntities\n$Nodes\n"),
        wrong(
            "there is a second section $Nodes: remove it",
            "Two files were put together.",
            "Merge the meshes in Gmsh.",
        )
        .two("$Elements\n", "$Nodes\n0\n$EndNodes\n$Elements\n"),
        wrong(
            "the file has no section $Nodes: save the mesh again",
            "Nothing was meshed, or the section is missing.",
            AGAIN,
        )
        .mesh("nothing but a head", "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n"),
        wrong(
            "expected $End<section> instead of `<text>`: there are more entries than announced, or the file is damaged",
            "The number at the beginning of the section is not that of its entries.",
            AGAIN,
        )
        .two("$Nodes\n6", "$Nodes\n5"),
        wrong(
            "the section $<section> does not end with $End<section>: the file is truncated or damaged",
            "The end of a section that is skipped is missing.",
            AGAIN,
        )
        .two("$Nodes", "$Knots"),
        wrong(
            "expected a name in quotes, such as \"top\"",
            "The name of a physical group stands in quotes.",
            AGAIN,
        )
        .two("7 \"the skin\"", "7 the skin"),
    ]
}

fn numbers() -> Vec<Entry> {
    vec![
        wrong(
            "expected a number instead of `<text>`: there are fewer entries than announced",
            "A section ends before all of its entries are there.",
            AGAIN,
        )
        .two("$Nodes\n6", "$Nodes\n7"),
        wrong(
            "expected <wanted> instead of `<text>`",
            "A number is not written as one.",
            AGAIN,
        )
        .two("4 0 0 1", "4 0 0 one"),
        wrong(
            "<count> nodes are announced, at most 4.2e9 are possible: coarsen the mesh",
            "The number of nodes is damaged, or too large for any machine.",
            AGAIN,
        )
        .two("$Nodes\n6", "$Nodes\n99999999999"),
        wrong(
            "<count> nodes are announced, but the blocks hold <count>: save the mesh again",
            "The numbers of the section contradict each other.",
            AGAIN,
        )
        .one("$Nodes\n1 4", "$Nodes\n1 5"),
        wrong(
            "<count> elements are announced, but the blocks hold <count>: save the mesh again",
            "The numbers of the section contradict each other.",
            AGAIN,
        )
        .one("$Elements\n1 1", "$Elements\n1 2"),
        wrong(
            "the header of the elements is damaged: save the mesh again",
            "A number of elements or of tags is negative.",
            AGAIN,
        )
        .two("2 2 2 7", "2 2 -2 7"),
        wrong(
            "node <tag> has a coordinate that is not finite: correct it in the mesh",
            "A coordinate is infinite or not a number.",
            "Correct the node, or mesh again.",
        )
        .two("4 0 0 1", "4 0 0 nan"),
        wrong(
            "the node <tag> has a negative tag: renumber the mesh",
            "Tags of nodes are positive.",
            "Renumber the mesh (Mesh.Renumber).",
        )
        .two("6 9 9 9", "-6 9 9 9"),
        wrong(
            "element <tag> has the node <tag>, a negative tag: renumber the mesh",
            "Tags of nodes are positive.",
            "Renumber the mesh (Mesh.Renumber).",
        )
        .two("1 2 3 4\n", "1 2 3 -4\n"),
        wrong(
            "element <tag> has the node <tag>, which is not there: save the mesh with all of its nodes",
            "An element names a node that the file does not have.",
            AGAIN,
        )
        .two("1 2 3 4\n", "1 2 3 44\n"),
        wrong(
            "node <tag> is there twice: remove one",
            "Two nodes have the same tag.",
            "Renumber the mesh (Mesh.Renumber).",
        )
        .two("4 0 0 1", "3 0 0 1"),
    ]
}

fn body() -> Vec<Entry> {
    vec![
        wrong(
            "elements of Gmsh's type <type> are not supported: save the mesh with linear or second-order elements \
             (Mesh.ElementOrder)",
            "The mesh has elements of a high order, or of a kind that is no solid.",
            "Set Mesh.ElementOrder to 1 or 2.",
        )
        .two("3 4 2 1 1 1 2 3 4", "3 29 2 1 1 1 2 3 4 5"),
        wrong(
            "element <tag> is a pyramid: only tetrahedra, hexahedra and prisms are possible; mesh the body with \
             tetrahedra",
            "Gmsh joins hexahedra and tetrahedra by pyramids, for which there are no operators.",
            "Mesh the body with tetrahedra alone.",
        )
        .two("3 4 2 1 1 1 2 3 4", "3 7 2 1 1 1 2 3 4 5"),
        wrong(
            "the mesh has no volume elements: mesh the volume (3D) and save it; where physical groups are defined, Gmsh \
             saves only what is in one, so define a physical volume too",
            "Only the surface was meshed, or only the surface is in a physical group.",
            "Mesh in 3D, and define a physical volume.",
        )
        .mesh(
            "surfaces alone",
            changed(
                &changed(TWO, "3 4 2 1 1 1 2 3 4\n4 4 2 1 1 2 3 4 5\n", ""),
                "$Elements\n4",
                "$Elements\n2",
            ),
        ),
        wrong(
            "element <tag> has the node <tag> twice: remove degenerate elements from the mesh",
            "An element is folded onto itself.",
            "Remove it, or mesh again.",
        )
        .two("1 2 3 4\n", "1 2 3 3\n"),
        wrong(
            "the surface element <tag> is not a face of any volume element: the surface and the volume do not fit \
             together; mesh both in one go",
            "Surface and volume were meshed apart, or with different orders.",
            "Mesh the body in 3D and save it whole.",
        )
        .two("7 1 1 3 2", "7 1 1 5 2"),
        wrong(
            "two physical surfaces have the name `<name>`: rename one",
            "Names that differ in characters other than letters, digits, `_` and `-` alone become equal.",
            "Rename one of the physical groups.",
        )
        .mesh(
            "two names that become one",
            changed(
                &changed(
                    &changed(TWO, "1\n2 7 \"the skin\"", "2\n2 7 \"the skin\"\n2 8 \"the_skin\""),
                    "$Elements\n4",
                    "$Elements\n5",
                ),
                "$EndElements",
                "5 2 2 8 1 1 2 4\n$EndElements",
            ),
        ),
        wrong(
            "the nodes <tag> and <tag> are at the same place: merge the duplicate nodes (Gmsh: Coherence in the \
             geometry, or Remove duplicate nodes in the mesh)",
            "Parts of the body touch without sharing nodes: it would be torn there.",
            "Use Coherence (or BooleanFragments) before meshing, or remove the duplicates.",
        )
        .two("4 0 0 1", "4 0 1 0"),
        wrong(
            "element <tag> is <fault>, and <count> more are: improve the mesh (Gmsh: Mesh.Optimize)",
            "An element has no volume, or a negative one.",
            "Optimize the mesh, or mesh again with other sizes.",
        )
        .variants(&["inverted", "flat, twisted or folded"])
        .two("1 2 3 4\n", "2 1 3 4\n")
        .two("5 1 1 1", "5 0.2 0.4 0.4"),
        entry(
            urlsph::Code::InvalidScene,
            "path",
            "<count> cells share the face at (<x>, <y>, <z>) m: cells overlap; mesh the body again without duplicates",
            "A face has a cell on either side at most.",
            "Remove the volumes that lie in each other, and mesh again.",
        )
        .mesh(
            "three cells at a face",
            changed(
                &changed(
                    &changed(&changed(TWO, "$Nodes\n6", "$Nodes\n7"), "6 9 9 9", "6 9 9 9\n7 2 2 3"),
                    "$Elements\n4",
                    "$Elements\n5",
                ),
                "$EndElements",
                "5 4 2 1 1 2 3 4 7\n$EndElements",
            ),
        ),
    ]
}
