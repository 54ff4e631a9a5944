//! Reader of Gmsh's `.msh` files: versions 2.2 and 4.1, text and binary.
//!
//! Strict where the mesh would be wrong: every error names the line (text) or the byte (binary) and
//! the element or node. What carries no geometry is skipped (lines, points, other sections, unused
//! nodes, the middle nodes of second-order elements), and [`MeshFile::notes`] says so.

use std::collections::BTreeMap;

use super::NONE;
use super::mesh::{Cell, CellKind, FLAT, face_key};
use crate::error::{Code, Error, Result};

/// What a mesh file holds, in metres.
#[derive(Debug)]
pub struct MeshFile {
    /// X [m] of the nodes that cells use, in the file's order.
    pub(super) nodes: Vec<[f64; 3]>,
    /// Tetrahedra, prisms and hexahedra, in the file's order.
    pub(super) cells: Vec<Cell>,
    /// Names of the physical surfaces.
    pub(super) names: Vec<String>,
    /// Surface elements with the index of their name; the fourth corner is `NONE` in a triangle.
    pub(super) named: Vec<([u32; 4], u32)>,
    /// What was left out or changed, one line each.
    pub(super) notes: Vec<String>,
}

impl MeshFile {
    /// Reads the content of a file; lengths in it are multiplied by `scale`.
    ///
    /// # Errors
    /// [`Code::Parse`] with the line or the byte.
    pub fn read(bytes: &[u8], scale: f64) -> Result<Self> {
        let mut reader = Reader {
            bytes,
            at: 0,
            binary: false,
            swapped: false,
        };
        let raw = reader.file()?;
        raw.mesh(&reader, scale)
    }
    /// Number of nodes in use.
    pub fn nodes(&self) -> usize {
        self.nodes.len()
    }
    /// Whether all cells are hexahedra.
    pub fn all_hexahedra(&self) -> bool {
        self.cells.iter().all(|c| c.kind == CellKind::Hexahedron)
    }
    /// Names of the physical surfaces, as the names of patches; `surface` where there are none.
    pub fn names(&self) -> &[String] {
        &self.names
    }
    /// What was left out or changed, one line each.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }
}

/// Content of a file before anything is checked against anything else.
#[derive(Default)]
struct Raw {
    /// Version 4.1; otherwise 2.2.
    modern: bool,
    /// Names by dimension and physical tag.
    names: BTreeMap<(i64, i64), String>,
    /// Physical tags of the surfaces of version 4.1, by entity.
    physical: BTreeMap<i64, Vec<i64>>,
    tags: Vec<u64>,
    points: Vec<[f64; 3]>,
    /// Where the node stands in the file.
    point_places: Vec<usize>,
    cells: Vec<RawElement>,
    /// Surface elements with a physical tag.
    surfaces: Vec<(RawElement, i64)>,
    /// Second-order elements.
    curved: usize,
}

/// An element: tag, place in the file, corners by tag; 0 beyond them.
#[derive(Clone, Copy)]
struct RawElement {
    tag: u64,
    place: usize,
    kind: Kind,
    corners: [u64; 8],
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    /// Points and lines.
    Thin,
    Triangle,
    Quadrilateral,
    Cell(CellKind),
    Pyramid,
}

/// Kind, number of nodes and of corners, and whether second order, of Gmsh's element types.
fn element_type(number: i64) -> Option<(Kind, usize, usize, bool)> {
    use CellKind::{Hexahedron, Prism, Tetrahedron};
    Some(match number {
        1 => (Kind::Thin, 2, 0, false),
        2 => (Kind::Triangle, 3, 3, false),
        3 => (Kind::Quadrilateral, 4, 4, false),
        4 => (Kind::Cell(Tetrahedron), 4, 4, false),
        5 => (Kind::Cell(Hexahedron), 8, 8, false),
        6 => (Kind::Cell(Prism), 6, 6, false),
        7 => (Kind::Pyramid, 5, 5, false),
        8 => (Kind::Thin, 3, 0, false),
        9 => (Kind::Triangle, 6, 3, true),
        10 => (Kind::Quadrilateral, 9, 4, true),
        11 => (Kind::Cell(Tetrahedron), 10, 4, true),
        12 => (Kind::Cell(Hexahedron), 27, 8, true),
        13 => (Kind::Cell(Prism), 18, 6, true),
        14 => (Kind::Pyramid, 14, 5, true),
        15 => (Kind::Thin, 1, 0, false),
        16 => (Kind::Quadrilateral, 8, 4, true),
        17 => (Kind::Cell(Hexahedron), 20, 8, true),
        18 => (Kind::Cell(Prism), 15, 6, true),
        19 => (Kind::Pyramid, 13, 5, true),
        _ => return None,
    })
}

struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
    binary: bool,
    /// The binary numbers are in the other byte order.
    swapped: bool,
}

impl<'a> Reader<'a> {
    fn wrong(&self, place: usize, message: impl std::fmt::Display) -> Error {
        let place = place.min(self.bytes.len());
        let text = if self.binary {
            format!("byte {place}: {message}")
        } else {
            let line = 1 + self.bytes[..place].iter().filter(|b| **b == b'\n').count();
            format!("line {line}: {message}")
        };
        Error::new(Code::Parse, text)
    }

    fn truncated(&self) -> Error {
        self.wrong(
            self.bytes.len(),
            "the file ends in the middle, it is truncated: save or copy it again",
        )
    }

    fn skip_space(&mut self) {
        while self.bytes.get(self.at).is_some_and(u8::is_ascii_whitespace) {
            self.at += 1;
        }
    }

    /// The rest of the line, without the space around it.
    fn line(&mut self) -> String {
        let rest = &self.bytes[self.at..];
        let length = rest.iter().position(|b| *b == b'\n');
        let text = String::from_utf8_lossy(&rest[..length.unwrap_or(rest.len())]);
        self.at += length.map_or(rest.len(), |l| l + 1);
        text.trim().to_owned()
    }

    fn token(&mut self) -> Result<&'a str> {
        self.skip_space();
        let rest = &self.bytes[self.at..];
        let end = rest.iter().position(u8::is_ascii_whitespace);
        let token = &rest[..end.unwrap_or(rest.len())];
        if token.is_empty() {
            return Err(self.truncated());
        }
        let text = std::str::from_utf8(token);
        match text {
            Ok(text) if !text.starts_with('$') && text.len() < 64 => {
                self.at += token.len();
                Ok(text)
            }
            _ => {
                let shown: String = String::from_utf8_lossy(token).chars().take(40).collect();
                Err(self.wrong(
                    self.at,
                    format!("expected a number instead of `{shown}`: there are fewer entries than announced"),
                ))
            }
        }
    }

    fn parsed<T: std::str::FromStr>(&mut self, what: &str) -> Result<T> {
        let text = self.token()?;
        let place = self.at - text.len();
        text.parse()
            .map_err(|_| self.wrong(place, format!("expected {what} instead of `{text}`")))
    }

    fn raw<const N: usize>(&mut self) -> Result<[u8; N]> {
        let bytes = self.bytes.get(self.at..).and_then(|b| b.first_chunk::<N>());
        let mut bytes = *bytes.ok_or_else(|| self.truncated())?;
        self.at += N;
        if self.swapped {
            bytes.reverse();
        }
        Ok(bytes)
    }

    /// An `int`.
    fn int(&mut self) -> Result<i64> {
        if self.binary {
            Ok(i64::from(i32::from_ne_bytes(self.raw()?)))
        } else {
            self.parsed("a whole number")
        }
    }

    /// A `size_t`.
    fn size(&mut self) -> Result<u64> {
        if self.binary {
            Ok(u64::from_ne_bytes(self.raw()?))
        } else {
            self.parsed("a whole number, 0 or more")
        }
    }

    fn real(&mut self) -> Result<f64> {
        if self.binary {
            Ok(f64::from_ne_bytes(self.raw()?))
        } else {
            self.parsed("a number")
        }
    }

    /// Room for entries that are announced, no more than the rest of the file can hold.
    fn room(&self, announced: u64, bytes_each: usize) -> usize {
        let most = (self.bytes.len() - self.at) / bytes_each + 1;
        usize::try_from(announced).unwrap_or(most).min(most)
    }

    fn file(&mut self) -> Result<Raw> {
        let mut raw = Raw::default();
        self.format(&mut raw)?;
        let mut nodes = false;
        loop {
            self.skip_space();
            let place = self.at;
            if place >= self.bytes.len() {
                break;
            }
            let header = self.line();
            let Some(name) = header.strip_prefix('$') else {
                let shown: String = header.chars().take(40).collect();
                return Err(self.wrong(
                    place,
                    format!(
                        "expected the beginning of a section, such as $Nodes, instead of `{shown}`"
                    ),
                ));
            };
            match name {
                "PhysicalNames" => self.names(&mut raw)?,
                "Entities" if raw.modern => self.entities(&mut raw)?,
                "PartitionedEntities" => {
                    return Err(
                        self.wrong(place, "the mesh is partitioned: save it without partitions")
                    );
                }
                "Nodes" => {
                    if nodes {
                        return Err(
                            self.wrong(place, "there is a second section $Nodes: remove it")
                        );
                    }
                    nodes = true;
                    if raw.modern {
                        self.nodes(&mut raw)?;
                    } else {
                        self.old_nodes(&mut raw)?;
                    }
                }
                "Elements" if raw.modern => self.elements(&mut raw)?,
                "Elements" => self.old_elements(&mut raw)?,
                _ => {
                    self.skip_section(place, name)?;
                    continue;
                }
            }
            self.skip_space();
            let place = self.at;
            let end = self.line();
            if end.is_empty() {
                return Err(self.truncated());
            }
            if end.strip_prefix("$End") != Some(name) {
                let shown: String = end.chars().take(40).collect();
                return Err(self.wrong(
                    place,
                    format!("expected $End{name} instead of `{shown}`: there are more entries than announced, or the file is damaged"),
                ));
            }
        }
        if !nodes {
            return Err(self.wrong(
                self.bytes.len(),
                "the file has no section $Nodes: save the mesh again",
            ));
        }
        Ok(raw)
    }

    fn format(&mut self, raw: &mut Raw) -> Result<()> {
        const WANTED: &str = "save the mesh as version 4.1 or 2.2 (Mesh.MshFileVersion)";
        self.skip_space();
        if self.line() != "$MeshFormat" {
            return Err(self.wrong(
                0,
                "this is no Gmsh mesh: it does not begin with $MeshFormat",
            ));
        }
        let version = self.token()?;
        raw.modern = match version {
            "4.1" => true,
            "2.2" | "2.1" | "2" => false,
            _ => {
                return Err(self.wrong(
                    self.at,
                    format!("version {version} is not supported: {WANTED}"),
                ));
            }
        };
        let kind = self.token()?;
        let size = self.token()?;
        if size != "8" {
            return Err(self.wrong(
                self.at,
                format!("numbers of {size} bytes are not supported, only of 8: {WANTED}"),
            ));
        }
        self.line();
        match kind {
            "0" => {}
            "1" => {
                let one = i32::from_ne_bytes(self.raw()?);
                self.swapped = one == 1i32.swap_bytes();
                if one != 1 && !self.swapped {
                    return Err(self.wrong(
                        self.at,
                        "the mark of the byte order is damaged: save the mesh again",
                    ));
                }
                self.binary = true;
            }
            _ => {
                return Err(self.wrong(
                    self.at,
                    format!(
                        "expected the file type 0 (text) or 1 (binary) instead of {kind}: {WANTED}"
                    ),
                ));
            }
        }
        self.skip_space();
        let place = self.at;
        if self.line() != "$EndMeshFormat" {
            return Err(self.wrong(
                place,
                "$MeshFormat does not end with $EndMeshFormat: save the mesh again",
            ));
        }
        Ok(())
    }

    fn skip_section(&mut self, place: usize, name: &str) -> Result<()> {
        let end = format!("$End{name}");
        let end = end.as_bytes();
        let rest = &self.bytes[self.at..];
        // `windows` panics at a length of 0, which `$End` is not.
        match rest.windows(end.len()).position(|w| w == end) {
            Some(found) => {
                self.at += found;
                self.line();
                Ok(())
            }
            None => Err(self.wrong(place, format!("the section ${name} does not end with $End{name}: the file is truncated or damaged"),
            )),
        }
    }

    fn names(&mut self, raw: &mut Raw) -> Result<()> {
        let count: u64 = self.parsed("the number of names")?;
        for _ in 0..count {
            let dimension: i64 = self.parsed("a dimension")?;
            let tag: i64 = self.parsed("a physical tag")?;
            let place = self.at;
            let rest = self.line();
            let name = rest
                .strip_prefix('"')
                .and_then(|r| r.split_once('"'))
                .map(|(name, _)| name.to_owned());
            let name = name
                .ok_or_else(|| self.wrong(place, "expected a name in quotes, such as \"top\""))?;
            raw.names.insert((dimension, tag), name);
        }
        Ok(())
    }

    fn entities(&mut self, raw: &mut Raw) -> Result<()> {
        let counts = [self.size()?, self.size()?, self.size()?, self.size()?];
        for (dimension, count) in counts.into_iter().enumerate() {
            for _ in 0..count {
                let tag = self.int()?;
                for _ in 0..if dimension == 0 { 3 } else { 6 } {
                    self.real()?;
                }
                let physical = self.size()?;
                let mut tags = Vec::with_capacity(self.room(physical, 2));
                for _ in 0..physical {
                    tags.push(self.int()?);
                }
                if dimension == 2 {
                    raw.physical.insert(tag, tags);
                }
                if dimension > 0 {
                    for _ in 0..self.size()? {
                        self.int()?;
                    }
                }
            }
        }
        Ok(())
    }

    fn node(&mut self, raw: &mut Raw, place: usize, tag: u64) -> Result<()> {
        let point = [self.real()?, self.real()?, self.real()?];
        if point.iter().any(|x| !x.is_finite()) {
            return Err(self.wrong(
                place,
                format!("node {tag} has a coordinate that is not finite: correct it in the mesh"),
            ));
        }
        raw.points.push(point);
        Ok(())
    }

    fn announce(&self, raw: &mut Raw, count: u64) -> Result<()> {
        if count >= u64::from(u32::MAX) {
            return Err(self.wrong(
                self.at,
                format!(
                    "{count} nodes are announced, at most 4.2e9 are possible: coarsen the mesh"
                ),
            ));
        }
        let room = self.room(count, 8);
        raw.tags.reserve(room);
        raw.points.reserve(room);
        raw.point_places.reserve(room);
        Ok(())
    }

    fn old_nodes(&mut self, raw: &mut Raw) -> Result<()> {
        let count: u64 = self.parsed("the number of nodes")?;
        self.line();
        self.announce(raw, count)?;
        for _ in 0..count {
            let place = self.place();
            let tag = self.int()?;
            let tag = u64::try_from(tag).map_err(|_| {
                self.wrong(
                    place,
                    format!("the node {tag} has a negative tag: renumber the mesh"),
                )
            })?;
            raw.tags.push(tag);
            raw.point_places.push(place);
            self.node(raw, place, tag)?;
        }
        Ok(())
    }

    /// Where the next entry begins.
    fn place(&mut self) -> usize {
        if !self.binary {
            self.skip_space();
        }
        self.at
    }

    fn nodes(&mut self, raw: &mut Raw) -> Result<()> {
        let (blocks, count) = (self.size()?, self.size()?);
        // The smallest and the largest tag.
        self.size()?;
        self.size()?;
        self.announce(raw, count)?;
        for _ in 0..blocks {
            let (dimension, _, parametric) = (self.int()?, self.int()?, self.int()?);
            let count = self.size()?;
            let first = raw.tags.len();
            for _ in 0..count {
                let place = self.place();
                raw.point_places.push(place);
                raw.tags.push(self.size()?);
            }
            for i in first..raw.tags.len() {
                let (place, tag) = (self.place(), raw.tags[i]);
                self.node(raw, place, tag)?;
                for _ in 0..if parametric == 0 {
                    0
                } else {
                    dimension.clamp(0, 3)
                } {
                    self.real()?;
                }
            }
        }
        if raw.points.len() as u64 != count {
            return Err(self.wrong(
                self.at,
                format!(
                    "{count} nodes are announced, but the blocks hold {}: save the mesh again",
                    raw.points.len()
                ),
            ));
        }
        Ok(())
    }

    fn known(&self, place: usize, number: i64) -> Result<(Kind, usize, usize, bool)> {
        element_type(number).ok_or_else(|| {
            self.wrong(
                place,
                format!(
                    "elements of Gmsh's type {number} are not supported: save the mesh with linear or \
                     second-order elements (Mesh.ElementOrder)"
                ),
            )
        })
    }

    /// An element from its nodes on.
    fn element(
        &mut self,
        raw: &mut Raw,
        (kind, nodes, corners, curved): (Kind, usize, usize, bool),
        place: usize,
        tag: u64,
        physical: &[i64],
    ) -> Result<()> {
        let mut element = RawElement {
            tag,
            place,
            kind,
            corners: [0; 8],
        };
        for n in 0..nodes {
            let node = if raw.modern {
                self.size()?
            } else {
                let node = self.int()?;
                u64::try_from(node).map_err(|_| {
                    self.wrong(
                        place,
                        format!(
                            "element {tag} has the node {node}, a negative tag: renumber the mesh"
                        ),
                    )
                })?
            };
            if n < corners {
                element.corners[n] = node;
            }
        }
        match kind {
            Kind::Thin => return Ok(()),
            Kind::Triangle | Kind::Quadrilateral => {
                for p in physical {
                    raw.surfaces.push((element, p.saturating_abs()));
                }
            }
            Kind::Cell(_) => raw.cells.push(element),
            Kind::Pyramid => {
                return Err(self.wrong(
                    place,
                    format!(
                        "element {tag} is a pyramid: only tetrahedra, hexahedra and prisms are possible; \
                         mesh the body with tetrahedra"
                    ),
                ));
            }
        }
        raw.curved += usize::from(curved);
        Ok(())
    }

    fn elements(&mut self, raw: &mut Raw) -> Result<()> {
        let (blocks, announced) = (self.size()?, self.size()?);
        // The smallest and the largest tag.
        self.size()?;
        self.size()?;
        let mut read = 0u64;
        for _ in 0..blocks {
            let place = self.place();
            let (dimension, entity, number) = (self.int()?, self.int()?, self.int()?);
            let kind = self.known(place, number)?;
            let count = self.size()?;
            let physical = if dimension == 2 {
                raw.physical.get(&entity).cloned().unwrap_or_default()
            } else {
                Vec::new()
            };
            for _ in 0..count {
                let place = self.place();
                let tag = self.size()?;
                self.element(raw, kind, place, tag, &physical)?;
                read += 1;
            }
        }
        if read != announced {
            return Err(self.wrong(
                self.at,
                format!(
                    "{announced} elements are announced, but the blocks hold {read}: save the mesh again"
                ),
            ));
        }
        Ok(())
    }

    fn old_elements(&mut self, raw: &mut Raw) -> Result<()> {
        let count: u64 = self.parsed("the number of elements")?;
        self.line();
        let mut read = 0;
        while read < count {
            let place = self.place();
            // In text every element has its own header, in binary a block has one.
            let (header, number, block, tags) = if self.binary {
                (0, self.int()?, self.int()?, self.int()?)
            } else {
                (self.int()?, self.int()?, 1, self.int()?)
            };
            let kind = self.known(place, number)?;
            if block < 1 || tags < 0 {
                return Err(self.wrong(
                    place,
                    "the header of the elements is damaged: save the mesh again",
                ));
            }
            for _ in 0..block {
                let place = if self.binary { self.place() } else { place };
                let tag = if self.binary { self.int()? } else { header };
                let mut physical = 0;
                for t in 0..tags {
                    let value = self.int()?;
                    if t == 0 {
                        physical = value;
                    }
                }
                let physical: &[i64] = if physical == 0 { &[] } else { &[physical] };
                self.element(raw, kind, place, tag.unsigned_abs(), physical)?;
                read += 1;
            }
        }
        Ok(())
    }
}

/// Nodes by tag.
enum Lookup {
    /// Tags that count up from the first.
    Contiguous(u64),
    Sorted(Vec<(u64, u32)>),
}

impl Raw {
    fn lookup(&self, reader: &Reader) -> Result<Lookup> {
        let first = self.tags.first().copied().unwrap_or(0);
        let counts_up =
            |(i, tag): (usize, &u64)| first.checked_add(i as u64).is_some_and(|t| t == *tag);
        if self.tags.iter().enumerate().all(counts_up) {
            return Ok(Lookup::Contiguous(first));
        }
        let mut sorted: Vec<(u64, u32)> = self
            .tags
            .iter()
            .enumerate()
            .map(|(i, tag)| (*tag, i as u32))
            .collect();
        sorted.sort_unstable();
        match sorted.windows(2).find(|w| w[0].0 == w[1].0) {
            Some(twice) => Err(reader.wrong(
                self.point_places[twice[1].1 as usize],
                format!("node {} is there twice: remove one", twice[1].0),
            )),
            None => Ok(Lookup::Sorted(sorted)),
        }
    }

    fn find(&self, lookup: &Lookup, tag: u64) -> Option<u32> {
        match lookup {
            Lookup::Contiguous(first) => tag
                .checked_sub(*first)
                .filter(|i| *i < self.tags.len() as u64)
                .map(|i| i as u32),
            Lookup::Sorted(sorted) => sorted
                .binary_search_by_key(&tag, |(t, _)| *t)
                .ok()
                .map(|i| sorted[i].1),
        }
    }

    fn mesh(mut self, reader: &Reader, scale: f64) -> Result<MeshFile> {
        let mut notes = Vec::new();
        if self.cells.is_empty() {
            return Err(reader.wrong(
                reader.bytes.len(),
                "the mesh has no volume elements: mesh the volume (3D) and save it; where physical \
                 groups are defined, Gmsh saves only what is in one, so define a physical volume too",
            ));
        }
        let lookup = self.lookup(reader)?;
        let resolve = |element: &RawElement, corners: usize| {
            let mut nodes = [NONE; 8];
            for (to, tag) in nodes.iter_mut().zip(&element.corners[..corners]) {
                *to = self.find(&lookup, *tag).ok_or_else(|| {
                    reader.wrong(
                        element.place,
                        format!(
                            "element {} has the node {tag}, which is not there: save the mesh with all of its nodes",
                            element.tag
                        ),
                    )
                })?;
            }
            Ok::<_, Error>(nodes)
        };
        let mut cells = Vec::with_capacity(self.cells.len());
        let mut places = Vec::with_capacity(self.cells.len());
        for element in &self.cells {
            let Kind::Cell(kind) = element.kind else {
                continue;
            };
            let nodes = resolve(element, kind.corners())?;
            let cell = Cell::new(kind, &nodes[..kind.corners()]);
            let mut sorted = cell.nodes().to_vec();
            sorted.sort_unstable();
            if let Some(twice) = sorted.windows(2).find(|w| w[0] == w[1]) {
                return Err(reader.wrong(
                    element.place,
                    format!(
                        "element {} has the node {} twice: remove degenerate elements from the mesh",
                        element.tag, self.tags[twice[0] as usize]
                    ),
                ));
            }
            cells.push(cell);
            places.push((element.tag, element.place));
        }
        drop_repeated(&mut cells, &mut places, &mut notes);

        let mut surfaces = Vec::with_capacity(self.surfaces.len());
        for (element, physical) in &self.surfaces {
            let corners = if element.kind == Kind::Triangle { 3 } else { 4 };
            let n = resolve(element, corners)?;
            surfaces.push((
                [n[0], n[1], n[2], n[3]],
                *physical,
                element.tag,
                element.place,
            ));
        }
        if self.curved > 0 {
            notes.push(format!(
                "{} second-order elements are taken as linear ones: their middle nodes are left out",
                self.curved
            ));
        }

        // Only the nodes of cells become particles, in the file's order.
        let mut used = vec![false; self.points.len()];
        for node in cells.iter().flat_map(Cell::nodes) {
            used[*node as usize] = true;
        }
        let mut new = vec![NONE; used.len()];
        let mut nodes = Vec::new();
        let mut tags = Vec::new();
        for (i, _) in used.iter().enumerate().filter(|(_, used)| **used) {
            new[i] = nodes.len() as u32;
            nodes.push(self.points[i].map(|x| x * scale));
            tags.push((self.tags[i], self.point_places[i]));
        }
        if nodes.len() < used.len() {
            notes.push(format!(
                "{} nodes that no volume element uses are left out",
                used.len() - nodes.len()
            ));
        }
        for cell in &mut cells {
            cell.renumber(|n| new[n as usize]);
        }
        check_places(reader, &nodes, &tags)?;
        orient(reader, &nodes, &mut cells, &places, &mut notes)?;

        let mut faces: Vec<[u32; 4]> = cells
            .iter()
            .flat_map(|cell| cell.faces().map(face_key))
            .collect();
        faces.sort_unstable();
        let mut groups: BTreeMap<i64, u32> = BTreeMap::new();
        let mut names = Vec::new();
        let mut named = Vec::with_capacity(surfaces.len());
        for (corners, physical, tag, place) in surfaces {
            let corners = corners.map(|n| if n == NONE { NONE } else { new[n as usize] });
            let key = face_key(corners);
            if faces.binary_search(&key).is_err() {
                return Err(reader.wrong(
                    place,
                    format!(
                        "the surface element {tag} is not a face of any volume element: the surface \
                         and the volume do not fit together; mesh both in one go"
                    ),
                ));
            }
            let index = match groups.get(&physical) {
                Some(index) => *index,
                None => {
                    let name = self.names.remove(&(2, physical));
                    let name = patch_name(name, physical);
                    if names.contains(&name) {
                        return Err(reader.wrong(
                            place,
                            format!("two physical surfaces have the name `{name}`: rename one"),
                        ));
                    }
                    let index = names.len() as u32;
                    names.push(name);
                    groups.insert(physical, index);
                    index
                }
            };
            named.push((corners, index));
        }
        if names.is_empty() {
            // Faces of one cell only: the whole surface.
            let alone = faces.chunk_by(|a, b| a == b).filter(|g| g.len() == 1);
            named.extend(alone.map(|g| (g[0], 0)));
            names.push("surface".to_owned());
            notes.push(
                "the file has no physical surfaces: the whole surface is the patch `surface`"
                    .into(),
            );
        }
        Ok(MeshFile {
            nodes,
            cells,
            names,
            named,
            notes,
        })
    }
}

/// Version 2.2 writes an element once for every physical group that it is in.
fn drop_repeated(cells: &mut Vec<Cell>, places: &mut Vec<(u64, usize)>, notes: &mut Vec<String>) {
    let mut keys: Vec<([u32; 8], u32)> = cells
        .iter()
        .enumerate()
        .map(|(i, cell)| {
            let mut key = [NONE; 8];
            key[..cell.nodes().len()].copy_from_slice(cell.nodes());
            key.sort_unstable();
            (key, i as u32)
        })
        .collect();
    keys.sort_unstable();
    let mut repeated = vec![false; cells.len()];
    for pair in keys.windows(2).filter(|w| w[0].0 == w[1].0) {
        repeated[pair[1].1 as usize] = true;
    }
    let count = repeated.iter().filter(|r| **r).count();
    if count > 0 {
        let mut keep = repeated.iter().map(|r| !r);
        cells.retain(|_| keep.next().unwrap_or(true));
        let mut keep = repeated.iter().map(|r| !r);
        places.retain(|_| keep.next().unwrap_or(true));
        notes.push(format!(
            "{count} volume elements that are there twice are taken once"
        ));
    }
}

/// Refuses nodes that stand on each other: the body would be torn there.
fn check_places(reader: &Reader, nodes: &[[f64; 3]], tags: &[(u64, usize)]) -> Result<()> {
    let extent = nodes.iter().flatten().fold(0.0f64, |m, x| m.max(x.abs()));
    // Equal up to the digits that a text file keeps.
    let rounded = |x: &[f64; 3]| x.map(|c| (c / extent * 1e10).round() as i64);
    let mut keys: Vec<([i64; 3], u32)> = nodes
        .iter()
        .enumerate()
        .map(|(i, x)| (rounded(x), i as u32))
        .collect();
    keys.sort_unstable();
    match keys.windows(2).find(|w| w[0].0 == w[1].0) {
        None => Ok(()),
        Some(pair) => {
            let [p, q] = [pair[0].1, pair[1].1].map(|i| tags[i as usize]);
            Err(reader.wrong(
                q.1,
                format!(
                    "the nodes {} and {} are at the same place: merge the duplicate nodes (Gmsh: \
                     Coherence in the geometry, or Remove duplicate nodes in the mesh)",
                    p.0, q.0
                ),
            ))
        }
    }
}

/// All cells right-handed; a mesh whose cells are all left-handed is turned.
fn orient(
    reader: &Reader,
    nodes: &[[f64; 3]],
    cells: &mut [Cell],
    places: &[(u64, usize)],
    notes: &mut Vec<String>,
) -> Result<()> {
    let good = |cell: &Cell| cell.shape_measure(nodes) > FLAT;
    let Some(bad) = cells.iter().position(|c| !good(c)) else {
        return Ok(());
    };
    let turned: Vec<Cell> = cells.iter().map(Cell::reversed).collect();
    if turned.iter().all(good) {
        cells.copy_from_slice(&turned);
        notes.push("all volume elements are left-handed in the file: they are turned".into());
        return Ok(());
    }
    let (tag, place) = places[bad];
    let what = if good(&turned[bad]) {
        "inverted"
    } else {
        "flat, twisted or folded"
    };
    let count = cells.iter().filter(|c| !good(c)).count();
    Err(reader.wrong(
        place,
        format!(
            "element {tag} is {what}, and {} more are: improve the mesh (Gmsh: Mesh.Optimize)",
            count - 1
        ),
    ))
}

/// A physical name as the name of a patch: what is no letter, digit, `_` or `-` becomes `_`.
fn patch_name(name: Option<String>, physical: i64) -> String {
    let name = name.unwrap_or_default();
    let mut clean: String = name
        .trim()
        .chars()
        .map(|c| {
            if c.is_ascii_alphanumeric() || c == '_' || c == '-' {
                c
            } else {
                '_'
            }
        })
        .collect();
    if clean.is_empty() {
        return format!("surface_{physical}");
    }
    if !clean.starts_with(|c: char| c.is_ascii_alphabetic()) {
        clean.insert_str(0, "surface_");
    }
    clean
}
