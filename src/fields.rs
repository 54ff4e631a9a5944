//! One table of the fields of a body: name, unit, shape, configuration. The C ABI, the FMU and the
//! writers all read it.

/// Configuration to which the components of a field belong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Configuration {
    /// Initial (material).
    Initial,
    /// Current (spatial).
    Current,
    /// Two-point: current row, initial column.
    TwoPoint,
}

/// Fields of a body, per particle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(usize)]
pub enum Field {
    /// Initial position X.
    InitialPosition,
    /// Current position x.
    Position,
    /// x - X.
    Displacement,
    /// Velocity v.
    Velocity,
    /// Total deformation gradient F = f F_chi.
    DeformationGradient,
    /// Jacobian J.
    Jacobian,
    /// First Piola-Kirchhoff stress P.
    FirstPiolaStress,
    /// Cauchy stress sigma = P F^T / J.
    CauchyStress,
    /// Pressure, -tr(sigma)/3.
    Pressure,
    /// Von Mises equivalent of the Cauchy stress.
    VonMisesStress,
    /// Strain energy per unit initial volume W.
    StrainEnergyDensity,
    /// Current density rho_R / J.
    Density,
    /// Tributary volume in the initial configuration.
    InitialVolume,
    /// Resultant of internal forces, loads and supports per particle.
    NodalForce,
    /// Absolute temperature theta; only with heat.
    Temperature,
    /// Entropy per unit initial volume eta; only with heat.
    Entropy,
    /// Equivalent plastic strain; only of a law with plasticity.
    EquivalentPlasticStrain,
}

/// Description of one field.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FieldInfo {
    /// The field.
    pub field: Field,
    /// Stable name.
    pub name: &'static str,
    /// SI unit, such as `m/s`; `1` if dimensionless.
    pub unit: &'static str,
    /// Number of components: 1, 3, or 9 (row-major 3 x 3).
    pub components: usize,
    /// Configuration.
    pub configuration: Configuration,
    /// One line for people.
    pub description: &'static str,
}

macro_rules! fields {
    ($($field:ident $name:literal $unit:literal $n:literal $conf:ident $text:literal;)*) => {
        /// All fields, in a fixed order: the index is the field's id.
        pub const FIELDS: &[FieldInfo] = &[$(FieldInfo {
            field: Field::$field, name: $name, unit: $unit, components: $n,
            configuration: Configuration::$conf, description: $text,
        }),*];
    };
}

fields! {
    InitialPosition "initial_position" "m" 3 Initial "Position in the initial configuration, X";
    Position "position" "m" 3 Current "Current position, x";
    Displacement "displacement" "m" 3 Current "Displacement, x - X";
    Velocity "velocity" "m/s" 3 Current "Velocity, v";
    DeformationGradient "deformation_gradient" "1" 9 TwoPoint "Deformation gradient, F";
    Jacobian "jacobian" "1" 1 Initial "Volume ratio, J";
    FirstPiolaStress "first_piola_stress" "Pa" 9 TwoPoint "First Piola-Kirchhoff stress, P";
    CauchyStress "cauchy_stress" "Pa" 9 Current "Cauchy stress, P F^T / J";
    Pressure "pressure" "Pa" 1 Current "Pressure, minus a third of the trace of the Cauchy stress";
    VonMisesStress "von_mises_stress" "Pa" 1 Current "Von Mises equivalent of the Cauchy stress";
    StrainEnergyDensity "strain_energy_density" "J/m^3" 1 Initial "Strain energy per unit initial volume, W";
    Density "density" "kg/m^3" 1 Current "Current density, rho_R / J";
    InitialVolume "initial_volume" "m^3" 1 Initial "Tributary volume in the initial configuration";
    NodalForce "nodal_force" "N" 3 Current "Sum of internal forces, loads and support reactions on a particle";
    Temperature "temperature" "K" 1 Current "Absolute temperature; only with heat";
    Entropy "entropy" "J/(m^3.K)" 1 Initial "Entropy per unit initial volume; only with heat";
    EquivalentPlasticStrain "equivalent_plastic_strain" "1" 1 Current "Equivalent plastic strain; only of a material with plasticity";
}

// `Field::info` looks a field up by its number.
const _: () = {
    let mut i = 0;
    while i < FIELDS.len() {
        assert!(FIELDS[i].field as usize == i);
        i += 1;
    }
};

impl FieldInfo {
    /// The field of this name.
    pub fn by_name(name: &str) -> Option<&'static FieldInfo> {
        FIELDS.iter().find(|f| f.name == name)
    }
}

impl Field {
    /// Its description.
    pub fn info(self) -> &'static FieldInfo {
        &FIELDS[self as usize]
    }
}
