//! Files of a run: the history as CSV, the fields as VTU files under a PVD collection.
//!
//! Every file is whole at any moment: it is written under a temporary name and renamed, or (the
//! history) grows by one row per write. A failure names the file and leaves the simulation alone.

mod history;
mod recorder;
pub mod variables;
mod vtu;

pub use history::History;
pub use recorder::RESTART;
pub use recorder::Recorder;
pub(crate) use recorder::{ACCURACY, ROUNDING, history_interval};
pub use vtu::{Collection, write_vtu};

use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::Path;

use crate::error::{Code, Error, Result};

/// Writes a file under a temporary name beside it and renames it, so that a reader never meets half a file.
pub fn replace_file(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> Result<()> {
    replace(path, write, |_| Ok(()))
}

/// The same for a file that is to outlive a loss of power: it is on the disk before it takes its name.
pub(crate) fn replace_file_durably(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> Result<()> {
    replace(path, write, File::sync_all)?;
    // The name is on the disk with its folder. Where folders cannot be opened, or synchronised, it follows later.
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
    if let Ok(folder) = File::open(folder.unwrap_or(Path::new("."))) {
        let _ = folder.sync_all();
    }
    Ok(())
}

fn replace(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
    finish: impl FnOnce(&File) -> io::Result<()>,
) -> Result<()> {
    let temporary = {
        let mut name = OsString::from(path);
        name.push(".part");
        name
    };
    let attempt = || {
        let mut out = BufWriter::new(File::create(&temporary)?);
        write(&mut out)?;
        out.flush()?;
        finish(out.get_ref())?;
        drop(out);
        fs::rename(&temporary, path)
    };
    attempt().map_err(|cause| {
        // The remains of a failed attempt are of no use; the first error is the one to report.
        let _ = fs::remove_file(&temporary);
        io_error("write", path, &cause)
    })
}

/// An input/output error that names the file and what was to be done with it.
pub(crate) fn io_error(action: &str, path: &Path, cause: &io::Error) -> Error {
    let remedy = match cause.kind() {
        io::ErrorKind::NotFound => "; does the folder exist?",
        io::ErrorKind::PermissionDenied => "; is the folder writable?",
        io::ErrorKind::StorageFull => "; free some space or write fewer fields less often",
        _ => "",
    };
    Error::new(
        Code::Io,
        format!("cannot {action} `{}`: {cause}{remedy}", path.display()),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hint_follows_the_reason() {
        for (kind, hint) in [
            (io::ErrorKind::NotFound, "; does the folder exist?"),
            (io::ErrorKind::PermissionDenied, "; is the folder writable?"),
            (
                io::ErrorKind::StorageFull,
                "; free some space or write fewer fields less often",
            ),
            (io::ErrorKind::TimedOut, ""),
        ] {
            let error = io_error("write", Path::new("r/history.csv"), &kind.into());
            assert_eq!(error.code(), Code::Io);
            let text = format!(
                "cannot write `r/history.csv`: {}{hint}",
                io::Error::from(kind)
            );
            assert_eq!(error.message(), text);
        }
    }
}
