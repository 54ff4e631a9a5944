//! The history: one CSV row per instant, first column `time`.

use std::fmt::Write as _;
use std::fs::{File, OpenOptions};
use std::io::Write as _;
use std::path::{Path, PathBuf};

use super::{io_error, replace_file};
use crate::error::{Error, Result};

/// A CSV file that grows by one row per instant and can be read while the run goes on.
#[derive(Debug)]
pub struct History {
    path: PathBuf,
    file: File,
    columns: usize,
}

impl History {
    /// Starts the file with its header: `time`, then `columns`. An older file is replaced.
    ///
    /// # Errors
    /// [`Code::Io`](crate::Code::Io) naming the file.
    pub fn create(
        path: impl Into<PathBuf>,
        columns: impl IntoIterator<Item: AsRef<str>>,
    ) -> Result<Self> {
        let path = path.into();
        let mut header = String::from("time");
        let mut count = 0;
        for name in columns {
            header.push(',');
            header.push_str(&quoted(name.as_ref()));
            count += 1;
        }
        header.push('\n');
        replace_file(&path, |out| out.write_all(header.as_bytes()))?;
        let file = OpenOptions::new()
            .append(true)
            .open(&path)
            .map_err(|cause| io_error("open", &path, &cause))?;
        Ok(Self {
            path,
            file,
            columns: count,
        })
    }

    /// Appends a row, in one write: a reader sees whole rows only.
    ///
    /// Numbers are printed with as many digits as it takes to read the same bits back.
    ///
    /// # Errors
    /// [`Code::InvalidArgument`](crate::Code::InvalidArgument) unless there is one value per column,
    /// [`Code::Io`](crate::Code::Io) naming the file.
    pub fn append(&mut self, time: f64, values: &[f64]) -> Result<()> {
        if values.len() != self.columns {
            return Err(Error::argument(format!(
                "a row of the history `{}` has {} values; pass one per column, {}",
                self.path.display(),
                values.len(),
                self.columns
            )));
        }
        let mut row = format!("{time:?}");
        for value in values {
            write!(row, ",{value:?}").expect("a String takes any text");
        }
        row.push('\n');
        self.file
            .write_all(row.as_bytes())
            .map_err(|cause| io_error("append to", &self.path, &cause))
    }

    /// Where the file is.
    pub fn path(&self) -> &Path {
        &self.path
    }
}

/// A name as a CSV field (RFC 4180): quoted if it holds a separator, a quote or a line end.
fn quoted(name: &str) -> String {
    if name.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", name.replace('"', "\"\""))
    } else {
        name.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Code;

    #[test]
    fn rows_read_back_bit_for_bit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("history.csv");
        let mut history = History::create(&path, ["a", "b[1]", "odd, \"name\""]).unwrap();
        let rows = [
            [0.1 + 0.2, -1.0 / 3.0, f64::MIN_POSITIVE],
            [1e300, 5e-324, -0.0],
        ];
        for (k, row) in rows.iter().enumerate() {
            history.append(k as f64 * 0.1, row).unwrap();
        }
        let text = std::fs::read_to_string(&path).unwrap();
        let mut lines = text.lines();
        assert_eq!(lines.next(), Some("time,a,b[1],\"odd, \"\"name\"\"\""));
        for (k, row) in rows.iter().enumerate() {
            let read: Vec<u64> = lines
                .next()
                .unwrap()
                .split(',')
                .map(|x| x.parse::<f64>().unwrap().to_bits())
                .collect();
            let written: Vec<u64> = std::iter::once(k as f64 * 0.1)
                .chain(*row)
                .map(f64::to_bits)
                .collect();
            assert_eq!(read, written);
        }
        assert_eq!(lines.next(), None);
    }

    #[test]
    fn a_row_of_the_wrong_length_is_refused_and_writes_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("history.csv");
        let mut history = History::create(&path, ["a", "b"]).unwrap();
        let error = history.append(0.0, &[1.0]).unwrap_err();
        assert_eq!(error.code(), Code::InvalidArgument);
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "time,a,b\n");
    }

    #[test]
    fn a_missing_folder_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("nowhere").join("history.csv");
        let error = History::create(&path, ["a"]).unwrap_err();
        assert_eq!(error.code(), Code::Io);
        assert!(error.message().contains("nowhere"), "{error}");
        assert!(
            error.message().contains("does the folder exist?"),
            "{error}"
        );
    }
}
