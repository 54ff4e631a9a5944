//! The ledger: what energy came in, what is stored, what was dissipated and by whom; momenta.

/// Energies [J]. Works and dissipations are accumulated since time 0 with the weights of the time
/// integrator.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Energies {
    /// Kinetic energy, sum of m v.v / 2.
    pub kinetic: f64,
    /// Strain energy, sum of V W.
    pub strain: f64,
    /// Work of tractions, pressures, body force and moving supports since time 0.
    pub external_work: f64,
    /// Energy dissipated by the scheme since time 0, from the dissipation terms themselves.
    pub numerical_dissipation: f64,
    /// Energy taken out by the angular-momentum projection since time 0 (of either sign).
    pub projection: f64,
    /// kinetic + strain + numerical_dissipation + projection - external_work - initial energy.
    pub closure_error: f64,
}

/// Momenta of the whole body.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Momenta {
    /// Linear momentum [kg m/s].
    pub linear: [f64; 3],
    /// Angular momentum about the origin [kg m^2/s].
    pub angular: [f64; 3],
}

/// What a patch feels and does; areas and normals of the initial configuration.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Resultant {
    /// Force of the surroundings on the body through this patch [N]: loads and support reactions.
    pub force: [f64; 3],
    /// Moment of that force about the origin, with current arms [N m].
    pub moment: [f64; 3],
    /// Area-weighted mean displacement [m].
    pub mean_displacement: [f64; 3],
    /// Area-weighted mean velocity [m/s].
    pub mean_velocity: [f64; 3],
}

/// Heat through a patch and its temperature; areas of the initial configuration.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct HeatResultant {
    /// Heat that flows into the body through this patch [W]: flux, convection, and what a
    /// prescribed temperature draws.
    pub heat_flow: f64,
    /// Area-weighted mean temperature [K].
    pub mean_temperature: f64,
    /// Highest temperature of its particles [K].
    pub maximum_temperature: f64,
}

/// Running totals since time 0: part of the state.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Accounts {
    /// Energy at time 0 [J].
    pub initial: f64,
    /// See [`Energies::external_work`].
    pub external_work: f64,
    /// See [`Energies::numerical_dissipation`].
    pub dissipation: f64,
    /// See [`Energies::projection`].
    pub projection: f64,
}

impl Accounts {
    /// The ledger with what is stored now.
    pub fn energies(&self, kinetic: f64, strain: f64) -> Energies {
        Energies {
            kinetic,
            strain,
            external_work: self.external_work,
            numerical_dissipation: self.dissipation,
            projection: self.projection,
            closure_error: kinetic + strain + self.dissipation + self.projection
                - self.external_work
                - self.initial,
        }
    }
}
