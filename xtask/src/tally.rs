//! Counting the tests of the many tools that run them.

use std::io::{BufRead, BufReader, Write};
use std::ops::AddAssign;
use std::process::{Command, Stdio};

use anyhow::{Context, Result};

/// How many tests passed and failed.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Tally {
    pub passed: usize,
    pub failed: usize,
}

impl AddAssign for Tally {
    fn add_assign(&mut self, other: Self) {
        self.passed += other.passed;
        self.failed += other.failed;
    }
}

impl Tally {
    /// A check that is one test.
    pub fn of<T, E: Into<anyhow::Error>>(outcome: Result<T, E>) -> Self {
        match outcome {
            Ok(_) => Self {
                passed: 1,
                failed: 0,
            },
            Err(error) => {
                eprintln!("error: {:#}", error.into());
                Self {
                    passed: 0,
                    failed: 1,
                }
            }
        }
    }

    /// Runs a command whose standard output has lines with `N passed` and `N failed` (libtest,
    /// pytest), shows that output, and adds the numbers up. A command that fails without a
    /// failed test, or passes without any test, counts as a failed one.
    pub fn run(command: impl Into<Command>) -> Result<Self> {
        Self::run_and_read(command, |_| ())
    }

    /// The same, and hands on every line of the output.
    pub fn run_and_read(command: impl Into<Command>, mut read: impl FnMut(&str)) -> Result<Self> {
        let mut command: Command = command.into();
        let mut child = command
            .stdout(Stdio::piped())
            .spawn()
            .with_context(|| format!("cannot start {command:?}"))?;
        let output = child.stdout.take().expect("the output is piped");
        let mut tally = Self::default();
        let mut shown = std::io::stdout().lock();
        for line in BufReader::new(output).split(b'\n') {
            let line = line?;
            let line = String::from_utf8_lossy(&line);
            writeln!(shown, "{line}")?;
            read(&line);
            tally += Self::parse(&line).unwrap_or_default();
        }
        let status = child.wait()?;
        if status.success() == (tally.failed > 0) || tally == Self::default() {
            eprintln!("error: {command:?} ended with {status} after {tally:?}");
            tally.failed = tally.failed.max(1);
        }
        Ok(tally)
    }

    /// The numbers of a summary line: `test result: ok. 6 passed; 0 failed; ...` or `==== 6 passed in 1 s ====`.
    fn parse(line: &str) -> Option<Self> {
        let line = line.trim_matches(|c| c == '=' || c == ' ');
        if !line.starts_with("test result:") && !line.starts_with(|c: char| c.is_ascii_digit()) {
            return None;
        }
        let words: Vec<&str> = line
            .split_whitespace()
            .map(|w| w.trim_end_matches([',', ';']))
            .collect();
        let number = |what: &str| {
            words
                .windows(2)
                .find(|pair| pair[1] == what)
                .and_then(|pair| pair[0].parse::<usize>().ok())
        };
        match (
            number("passed"),
            number("failed"),
            number("errors").or(number("error")),
        ) {
            (None, None, None) => None,
            (passed, failed, errors) => Some(Self {
                passed: passed.unwrap_or(0),
                failed: failed.unwrap_or(0) + errors.unwrap_or(0),
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn summary_lines_are_read() {
        let tally = |passed, failed| Some(Tally { passed, failed });
        assert_eq!(
            Tally::parse(
                "test result: FAILED. 12 passed; 3 failed; 1 ignored; 0 measured; 0 filtered out; finished in 0.00s"
            ),
            tally(12, 3)
        );
        assert_eq!(
            Tally::parse("===== 1 failed, 7 passed, 2 warnings in 0.12s ====="),
            tally(7, 1)
        );
        assert_eq!(Tally::parse("7 passed, 1 error in 0.12s"), tally(7, 1));
        assert_eq!(Tally::parse("9 passed in 0.12s"), tally(9, 0));
        assert_eq!(Tally::parse("the residual 3 passed"), None);
        assert_eq!(Tally::parse("running 6 tests"), None);
    }

    #[test]
    fn a_command_without_tests_has_failed() {
        let tally = Tally::run(Command::new("true")).unwrap();
        assert_eq!(
            tally,
            Tally {
                passed: 0,
                failed: 1
            }
        );
    }
}
