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
        let (header, count) = header(columns);
        Self::start(path, count, &header)
    }

    /// Goes on with a file that was written before, without the rows after `time`.
    ///
    /// # Errors
    /// [`Code::Io`](crate::Code::Io) naming the file, if there is none;
    /// [`Code::InvalidArgument`](crate::Code::InvalidArgument) if it has other columns.
    pub fn resume(
        path: impl Into<PathBuf>,
        columns: impl IntoIterator<Item: AsRef<str>>,
        time: f64,
    ) -> Result<Self> {
        let path = path.into();
        let (header, count) = header(columns);
        let text =
            std::fs::read_to_string(&path).map_err(|cause| io_error("read", &path, &cause))?;
        if !text.starts_with(&header) {
            return Err(Error::argument(format!(
                "the history `{}` has other columns than this run: its probes or patches were others; start \
                 the run afresh",
                path.display()
            )));
        }
        // The last row may have been cut off in the middle.
        let whole = text[header.len()..].split_inclusive('\n');
        let is_kept = |row: &&str| {
            let number = row.split([',', '\n']).next().unwrap_or_default();
            row.ends_with('\n') && number.parse::<f64>().is_ok_and(|t| t <= time)
        };
        let kept: String = whole.take_while(is_kept).collect();
        Self::start(path, count, &(header + &kept))
    }

    /// A file with this content, to be appended to.
    fn start(path: PathBuf, columns: usize, content: &str) -> Result<Self> {
        replace_file(&path, |out| out.write_all(content.as_bytes()))?;
        let file = OpenOptions::new()
            .append(true)
            .open(&path)
            .map_err(|cause| io_error("open", &path, &cause))?;
        Ok(Self {
            path,
            file,
            columns,
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

/// The first line, and how many columns there are besides the time.
fn header(columns: impl IntoIterator<Item: AsRef<str>>) -> (String, usize) {
    let mut header = String::from("time");
    let mut count = 0;
    for name in columns {
        header.push(',');
        header.push_str(&quoted(name.as_ref()));
        count += 1;
    }
    header.push('\n');
    (header, count)
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
    fn a_file_goes_on_where_a_time_ends() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("history.csv");
        let mut history = History::create(&path, ["a"]).unwrap();
        for time in [0.0, 0.1, 0.2, 0.3] {
            history.append(time, &[10.0 * time]).unwrap();
        }
        drop(history);
        // A row that a killed process did not finish.
        let mut text = std::fs::read_to_string(&path).unwrap();
        text += "0.1";
        std::fs::write(&path, text).unwrap();
        let mut history = History::resume(&path, ["a"], 0.1).unwrap();
        history.append(0.15, &[7.0]).unwrap();
        assert_eq!(
            std::fs::read_to_string(&path).unwrap(),
            "time,a\n0.0,0.0\n0.1,1.0\n0.15,7.0\n"
        );
        let error = History::resume(&path, ["b"], 0.1).unwrap_err();
        assert_eq!(error.code(), Code::InvalidArgument, "{error}");
        let error = History::resume(folder.path().join("none.csv"), ["a"], 0.1).unwrap_err();
        assert_eq!(error.code(), Code::Io, "{error}");
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
