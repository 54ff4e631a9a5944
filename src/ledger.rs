//! The ledger: what energy came in, what is stored, what was dissipated and by whom; momenta.

use crate::boundary::Exchange;
use crate::formulation::url::{Evaluation, Plastic};

/// Energies [J] and entropies [J/K]. Works, heats and dissipations are accumulated since time 0 with
/// the weights of the time integrator. What a scene does not have is 0.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[non_exhaustive]
pub struct Energies {
    /// Kinetic energy, sum of m v.v / 2.
    pub kinetic: f64,
    /// Strain energy, sum of V W; with heat the mechanical part of the internal energy ([URL23] 27, 35).
    pub strain: f64,
    /// Thermal part of the internal energy, sum of V c_v (theta - theta_R) ([URL23] 20).
    pub thermal: f64,
    /// Work of tractions, pressures, body force, moving supports and planes since time 0.
    pub external_work: f64,
    /// Heat from sources, heat fluxes, convection and prescribed temperatures since time 0.
    pub heat_in: f64,
    /// Plastic work since time 0. With heat its part that becomes heat is in `thermal` as well.
    pub plastic_work: f64,
    /// Energy dissipated by the scheme since time 0, from the dissipation terms themselves.
    pub numerical_dissipation: f64,
    /// Kinetic energy lost in inelastic contact since time 0: that of the layer of particles that a
    /// plane stops, which vanishes with the spacing. Never falls.
    pub contact_dissipation: f64,
    /// Energy taken out by the angular-momentum projection since time 0 (of either sign).
    pub projection: f64,
    /// Ballistic energy, kinetic + strain + thermal - theta_R entropy ([URL23] 45): without supply
    /// from outside it never rises.
    pub ballistic: f64,
    /// Entropy, sum of V eta [J/K].
    pub entropy: f64,
    /// Entropy produced by conduction and plastic flow since time 0 [J/K]: never falls.
    pub entropy_production: f64,
    /// What is stored and dissipated less what was supplied and the initial energy: kinetic + strain +
    /// thermal + plastic work that did not become heat + numerical_dissipation +
    /// contact_dissipation + projection - external_work - heat_in - initial energy.
    pub closure_error: f64,
}

/// Momenta of the whole body.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[non_exhaustive]
pub struct Momenta {
    /// Linear momentum [kg m/s].
    pub linear: [f64; 3],
    /// Angular momentum about the origin [kg m^2/s].
    pub angular: [f64; 3],
}

/// What a patch feels and does; areas and normals of the initial configuration.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[non_exhaustive]
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
#[non_exhaustive]
pub struct HeatResultant {
    /// Heat that flows into the body through this patch [W]: flux, convection, and what a
    /// prescribed temperature draws.
    pub heat_flow: f64,
    /// Area-weighted mean temperature [K].
    pub mean_temperature: f64,
    /// Highest temperature of its particles [K].
    pub maximum_temperature: f64,
}

/// What a plane of contact does to the body.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
#[non_exhaustive]
pub struct ContactResultant {
    /// Force of the plane on the body now [N], without the impulses of impacts.
    pub force: [f64; 3],
    /// Impulse of the plane on the body since time 0 [N s], with those of impacts.
    pub impulse: [f64; 3],
    /// Number of particles that touch the plane.
    pub particles: usize,
    /// How far the plane has moved along its normal since time 0 [m].
    pub displacement: f64,
}

/// All resultants of one state.
#[derive(Debug, Default)]
pub(crate) struct Resultants {
    /// By patch.
    pub patches: Vec<Resultant>,
    /// By patch, of a body with heat.
    pub heat: Vec<HeatResultant>,
    /// By plane.
    pub contacts: Vec<ContactResultant>,
}

/// Running totals since time 0: part of the state.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Accounts {
    /// Energy at time 0 [J].
    pub initial: f64,
    /// See [`Energies::heat_in`].
    pub heat_in: f64,
    /// What plastic flow did.
    pub plastic: Plastic,
    /// Entropy that conduction produced [J/K].
    pub conduction: f64,
    /// See [`Energies::external_work`].
    pub external_work: f64,
    /// See [`Energies::numerical_dissipation`].
    pub dissipation: f64,
    /// See [`Energies::contact_dissipation`].
    pub contact: f64,
    /// See [`Energies::projection`].
    pub projection: f64,
}

impl Accounts {
    /// Takes over what contact did in one step.
    pub fn exchange(&mut self, contact: Exchange) {
        self.external_work += contact.work;
        self.contact += contact.dissipation;
    }

    /// The ledger with what is stored now.
    pub fn energies(&self, now: &Evaluation, reference_temperature: f64) -> Energies {
        let stored = now.kinetic + now.strain + now.thermal;
        let lost = self.plastic.work - self.plastic.heat
            + self.dissipation
            + self.contact
            + self.projection;
        Energies {
            kinetic: now.kinetic,
            strain: now.strain,
            thermal: now.thermal,
            external_work: self.external_work,
            heat_in: self.heat_in,
            plastic_work: self.plastic.work,
            numerical_dissipation: self.dissipation,
            contact_dissipation: self.contact,
            projection: self.projection,
            ballistic: stored - reference_temperature * now.entropy,
            entropy: now.entropy,
            entropy_production: self.conduction + self.plastic.entropy,
            closure_error: stored + lost - self.external_work - self.heat_in - self.initial,
        }
    }
}
