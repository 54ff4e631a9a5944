//! Numbers as a host may pass them.

use arbitrary::Arbitrary;

#[derive(Debug, Clone, Copy, Arbitrary)]
pub enum Number {
    Small(i8),
    Share(u8),
    Any(f64),
    Nan,
    Infinite,
    Largest,
    Smallest,
    Now,
}

impl Number {
    /// The number, at a time.
    pub fn value(self, now: f64) -> f64 {
        match self {
            Self::Small(n) => f64::from(n),
            Self::Share(n) => f64::from(n) * 1e-6,
            Self::Any(x) => x,
            Self::Nan => f64::NAN,
            Self::Infinite => f64::INFINITY,
            Self::Largest => f64::MAX,
            Self::Smallest => f64::MIN_POSITIVE,
            Self::Now => now,
        }
    }
}
