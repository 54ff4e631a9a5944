//! Fields as VTU files (one vertex per particle) and the PVD collection that lists them by time.
//!
//! The XML around the numbers is fixed and holds no free text, so it is written as it stands; the
//! numbers are appended raw (little-endian, 64-bit headers), the densest form that ParaView reads.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use super::{io_error, replace_file};
use crate::error::{Error, Result};
use crate::fields::{Field, FieldInfo};
use crate::simulation::Simulation;

/// Writes the present state: one vertex per particle at its current position, with the fields as point data.
///
/// # Errors
/// [`Code::Io`](crate::Code::Io) naming the file. The simulation is only read.
pub fn write_vtu(path: &Path, simulation: &Simulation, fields: &[Field]) -> Result<()> {
    let read = |field: Field| -> Result<Vec<f64>> {
        let mut values = vec![0.0; simulation.particle_count() * field.info().components];
        simulation.read_field(field, &mut values)?;
        Ok(values)
    };
    let position = read(Field::Position)?;
    let arrays = fields
        .iter()
        .map(|&field| Ok((field.info(), read(field)?)))
        .collect::<Result<Vec<_>>>()?;
    replace_file(path, |out| {
        encode(out, simulation.time(), &position, &arrays)
    })
}

/// One appended array: its XML attributes and its bytes.
struct Block<'a> {
    attributes: String,
    data: Data<'a>,
}

enum Data<'a> {
    Numbers(&'a [f64]),
    Indices(Vec<i64>),
    Bytes(Vec<u8>),
}

impl<'a> Block<'a> {
    fn numbers(name: &str, components: usize, values: &'a [f64]) -> Self {
        Self {
            attributes: format!(
                r#"type="Float64" Name="{name}" NumberOfComponents="{components}""#
            ),
            data: Data::Numbers(values),
        }
    }
    fn len(&self) -> usize {
        match &self.data {
            Data::Numbers(v) => size_of_val(*v),
            Data::Indices(v) => size_of_val(v.as_slice()),
            Data::Bytes(v) => v.len(),
        }
    }
    fn write(&self, out: &mut impl Write) -> io::Result<()> {
        out.write_all(&(self.len() as u64).to_le_bytes())?;
        match &self.data {
            Data::Numbers(v) => v.iter().try_for_each(|x| out.write_all(&x.to_le_bytes())),
            Data::Indices(v) => v.iter().try_for_each(|x| out.write_all(&x.to_le_bytes())),
            Data::Bytes(v) => out.write_all(v),
        }
    }
}

fn encode(
    out: &mut impl Write,
    time: f64,
    position: &[f64],
    arrays: &[(&FieldInfo, Vec<f64>)],
) -> io::Result<()> {
    let particles = position.len() / 3;
    let points = Block::numbers("position", 3, position);
    let cells = [
        Block {
            attributes: r#"type="Int64" Name="connectivity""#.into(),
            data: Data::Indices((0..particles as i64).collect()),
        },
        Block {
            attributes: r#"type="Int64" Name="offsets""#.into(),
            data: Data::Indices((1..=particles as i64).collect()),
        },
        Block {
            attributes: r#"type="UInt8" Name="types""#.into(),
            // VTK_VERTEX.
            data: Data::Bytes(vec![1; particles]),
        },
    ];
    let point_data: Vec<Block<'_>> = arrays
        .iter()
        .map(|(info, values)| Block::numbers(info.name, info.components, values))
        .collect();

    let mut offset = 0;
    let mut declare = |out: &mut dyn Write, block: &Block<'_>| {
        writeln!(
            out,
            r#"        <DataArray {} format="appended" offset="{offset}"/>"#,
            block.attributes
        )?;
        offset += size_of::<u64>() + block.len();
        io::Result::Ok(())
    };
    writeln!(out, r#"<?xml version="1.0"?>"#)?;
    writeln!(
        out,
        r#"<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" header_type="UInt64">"#
    )?;
    writeln!(out, "  <UnstructuredGrid>")?;
    writeln!(out, "    <FieldData>")?;
    writeln!(
        out,
        r#"      <DataArray type="Float64" Name="TimeValue" NumberOfTuples="1" format="ascii">{time:?}</DataArray>"#
    )?;
    writeln!(out, "    </FieldData>")?;
    writeln!(
        out,
        r#"    <Piece NumberOfPoints="{particles}" NumberOfCells="{particles}">"#
    )?;
    writeln!(out, "      <PointData>")?;
    for block in &point_data {
        declare(out, block)?;
    }
    writeln!(out, "      </PointData>")?;
    writeln!(out, "      <Points>")?;
    declare(out, &points)?;
    writeln!(out, "      </Points>")?;
    writeln!(out, "      <Cells>")?;
    for block in &cells {
        declare(out, block)?;
    }
    writeln!(out, "      </Cells>")?;
    writeln!(out, "    </Piece>")?;
    writeln!(out, "  </UnstructuredGrid>")?;
    write!(out, "  <AppendedData encoding=\"raw\">\n_")?;
    for block in point_data.iter().chain([&points]).chain(&cells) {
        block.write(out)?;
    }
    writeln!(out, "\n  </AppendedData>\n</VTKFile>")
}

/// A PVD file that lists VTU files by time. It is rewritten after every file, so that what an
/// interrupted run has written can be opened.
#[derive(Debug)]
pub struct Collection {
    path: PathBuf,
    entries: String,
}

/// Beginning of a line of the collection.
const ENTRY: &str = "<DataSet timestep=\"";

impl Collection {
    /// Writes an empty collection. An older file is replaced.
    ///
    /// # Errors
    /// [`Code::Io`](crate::Code::Io) naming the file.
    pub fn create(path: impl Into<PathBuf>) -> Result<Self> {
        let collection = Self {
            path: path.into(),
            entries: String::new(),
        };
        collection.write()?;
        Ok(collection)
    }

    /// Goes on with a collection that was written before, without what came after `time`.
    ///
    /// # Errors
    /// [`Code::Io`](crate::Code::Io) naming the file.
    pub fn resume(path: impl Into<PathBuf>, time: f64) -> Result<Self> {
        let path = path.into();
        let text =
            std::fs::read_to_string(&path).map_err(|cause| io_error("read", &path, &cause))?;
        let is_kept = |line: &&str| {
            let rest = line.trim_start().strip_prefix(ENTRY);
            let number = rest.and_then(|rest| rest.split_once('"'));
            number.is_some_and(|(number, _)| number.parse::<f64>().is_ok_and(|t| t <= time))
        };
        let mut collection = Self {
            path,
            entries: String::new(),
        };
        for line in text.lines().filter(is_kept) {
            collection.entries += line;
            collection.entries.push('\n');
        }
        collection.write()?;
        Ok(collection)
    }

    /// Number of files.
    pub fn len(&self) -> usize {
        self.entries.lines().count()
    }

    /// Whether it has no files.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Adds a file, given by its path relative to the collection with `/` between folders.
    ///
    /// # Errors
    /// [`Code::InvalidArgument`](crate::Code::InvalidArgument) for a path that XML would have to escape,
    /// [`Code::Io`](crate::Code::Io) naming the collection.
    pub fn add(&mut self, time: f64, file: &str) -> Result<()> {
        if file.contains(['<', '>', '&', '"']) {
            return Err(Error::argument(format!(
                "the field file `{file}` has <, >, & or \" in its name; choose another"
            )));
        }
        self.entries += &format!("    {ENTRY}{time:?}\" file=\"{file}\"/>\n");
        self.write()
    }

    fn write(&self) -> Result<()> {
        replace_file(&self.path, |out| {
            write!(
                out,
                "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"1.0\">\n  <Collection>\n{}  </Collection>\n</VTKFile>\n",
                self.entries
            )
        })
    }

    /// Where the file is.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Code;

    /// The bytes of the array called `name`, found as a reader finds them: by its `offset`.
    fn appended<'a>(file: &'a [u8], name: &str) -> (&'a str, &'a [u8]) {
        let marker = b"<AppendedData encoding=\"raw\">\n_";
        let start = file
            .windows(marker.len())
            .position(|w| w == marker)
            .expect("appended data")
            + marker.len();
        let header = std::str::from_utf8(&file[..start]).unwrap();
        let line = header
            .lines()
            .find(|line| line.contains(&format!("Name=\"{name}\"")))
            .expect("declared array");
        let offset = line.split("offset=\"").nth(1).unwrap();
        let offset: usize = offset[..offset.find('"').unwrap()].parse().unwrap();
        let block = &file[start + offset..];
        let length = u64::from_le_bytes(block[..8].try_into().unwrap()) as usize;
        (line, &block[8..8 + length])
    }

    fn eight<T>(bytes: &[u8], from: impl Fn([u8; 8]) -> T) -> Vec<T> {
        bytes
            .chunks_exact(8)
            .map(|b| from(b.try_into().unwrap()))
            .collect()
    }

    #[test]
    fn every_bit_is_found_by_its_offset() {
        let n = 5;
        let position: Vec<f64> = (0..3 * n).map(|k| 0.1 + k as f64 / 7.0).collect();
        let arrays: Vec<(&FieldInfo, Vec<f64>)> =
            [Field::Velocity, Field::CauchyStress, Field::Jacobian]
                .map(|field| {
                    let info = field.info();
                    let values = (0..n * info.components)
                        .map(|k| (k as f64 - 3.0) * 1e-3 / 3.0)
                        .collect();
                    (info, values)
                })
                .into();
        let mut file = Vec::new();
        encode(&mut file, 0.3, &position, &arrays).unwrap();

        let (_, bytes) = appended(&file, "position");
        assert_eq!(eight(bytes, f64::from_le_bytes), position);
        for (info, values) in &arrays {
            let (line, bytes) = appended(&file, info.name);
            assert!(line.contains(&format!("NumberOfComponents=\"{}\"", info.components)));
            assert_eq!(&eight(bytes, f64::from_le_bytes), values);
        }
        let (_, bytes) = appended(&file, "connectivity");
        assert_eq!(eight(bytes, i64::from_le_bytes), [0, 1, 2, 3, 4]);
        let (_, bytes) = appended(&file, "offsets");
        assert_eq!(eight(bytes, i64::from_le_bytes), [1, 2, 3, 4, 5]);
        let (_, bytes) = appended(&file, "types");
        assert_eq!(bytes, [1; 5]);
        assert!(file.ends_with(b"\n  </AppendedData>\n</VTKFile>\n"));
    }

    #[test]
    fn the_collection_is_whole_after_every_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("fields.pvd");
        let mut collection = Collection::create(&path).unwrap();
        for k in 0..3 {
            let text = std::fs::read_to_string(&path).unwrap();
            assert_eq!(text.matches("<DataSet ").count(), k);
            assert!(text.ends_with("</VTKFile>\n"));
            collection
                .add(k as f64 * 0.1, &format!("fields/{k}.vtu"))
                .unwrap();
        }
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(
            text.contains(r#"timestep="0.2" file="fields/2.vtu""#),
            "{text}"
        );
        let files: Vec<_> = folder.path().read_dir().unwrap().collect();
        assert_eq!(files.len(), 1, "no temporary file stays behind");
    }

    #[test]
    fn a_name_that_would_break_the_xml_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let mut collection = Collection::create(folder.path().join("fields.pvd")).unwrap();
        let error = collection.add(0.0, "a\"b.vtu").unwrap_err();
        assert_eq!(error.code(), Code::InvalidArgument);
    }
}
