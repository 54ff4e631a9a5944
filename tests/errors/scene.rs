//! What a scene says: material, heat, numerics, conditions, patches, output.

use urlsph::Code::InvalidScene as S;

use crate::catalogue::{Entry, entry};

const METAL: &str = r#"material={"johnson_cook": {"density": 8960, "youngs_modulus": 124e9,
    "poisson_ratio": 0.34, "yield_stress": 90e6, "hardening_modulus": 292e6, "hardening_exponent": 0.31,
    "rate_coefficient": 0.025, "reference_strain_rate": 1, "softening_exponent": 1.09,
    "transition_temperature": 2000, "melting_temperature": 1356}}"#;
const SATURATION_ALONE: &str = r#"material={"von_mises": {"density": 1, "youngs_modulus": 1,
    "poisson_ratio": 0, "yield_stress": 10, "hardening_modulus": 0, "saturation_stress": 20}}"#;
const SATURATION_BELOW: &str = r#"material={"von_mises": {"density": 1, "youngs_modulus": 1,
    "poisson_ratio": 0, "yield_stress": 10, "hardening_modulus": 0, "saturation_stress": 9,
    "saturation_exponent": 1}}"#;
const SHARE: &str = r#"material={"mooney_rivlin": {"density": 1, "youngs_modulus": 1,
    "poisson_ratio": 0, "area_share": 1.5}}"#;
const HEAT: &str = r#"heat={"specific_heat": 1, "reference_temperature": 300}"#;

pub fn entries() -> Vec<Entry> {
    [
        properties(),
        numerics(),
        conditions(),
        planes(),
        initial(),
        names(),
    ]
    .into_iter()
    .flatten()
    .collect()
}

fn properties() -> Vec<Entry> {
    vec![
        entry(
            S,
            "path",
            "expected a finite number above 0 instead of <value>",
            "A quantity that must be positive is not: a length, a time, a density, a stiffness.",
            "Give a number above 0, in SI units.",
        )
        .scene(&["material.neo_hookean.density=-1"], "material.neo_hookean.density")
        .scene(&["geometry.box.spacing=0"], "geometry.box.spacing")
        .scene(&["time.end=0"], "time.end")
        .scene(&["output.field_interval=0"], "output.field_interval")
        .scene(&[HEAT, "heat.specific_heat=0"], "heat.specific_heat")
        .scene(&["numerics.time_step=0"], "numerics.time_step"),
        entry(
            S,
            "path",
            "expected a finite number, 0 or more, instead of <value>",
            "A quantity that may be 0 is negative.",
            "Give 0 or a positive number.",
        )
        .scene(&[HEAT, "heat.conductivity=-1"], "heat.conductivity")
        .scene(&["numerics.volume_dissipation=-1"], "numerics.volume_dissipation")
        .scene(
            &[METAL, "material.johnson_cook.rate_coefficient=-1"],
            "material.johnson_cook.rate_coefficient",
        ),
        entry(
            S,
            "path",
            "expected more than -1 and less than 0.5 instead of <value>",
            "With this Poisson ratio the stiffness in shear or in volume is not positive.",
            "Give a ratio in that range; nearly incompressible matter has 0.49 and small steps.",
        )
        .scene(
            &["material.neo_hookean.poisson_ratio=0.5"],
            "material.neo_hookean.poisson_ratio",
        ),
        entry(
            S,
            "path",
            "expected a share from 0 to 1 instead of <value>",
            "The share of the shear stiffness that goes with areas is none.",
            "Give a number from 0 (neo-Hookean) to 1.",
        )
        .scene(&[SHARE], "material.mooney_rivlin.area_share"),
        entry(
            S,
            "path",
            "expected a number from 0 to 1 instead of <value>",
            "An exponent or a fraction of the section `heat` is out of its range.",
            "Give a number from 0 to 1.",
        )
        .scene(&[HEAT, "heat.plastic_heat_fraction=2"], "heat.plastic_heat_fraction"),
        entry(
            S,
            "path",
            "saturation hardening needs `<key>` too",
            "One of the two numbers of saturation hardening is missing.",
            "Give both, or none for linear hardening.",
        )
        .scene(&[SATURATION_ALONE], "material.von_mises.saturation_stress"),
        entry(
            S,
            "path",
            "expected a number not below `yield_stress`, <stress>, instead of <stress>",
            "The stress at saturation is below the stress at which the metal begins to yield.",
            "Raise it, or leave saturation out.",
        )
        .scene(&[SATURATION_BELOW], "material.von_mises.saturation_stress"),
        entry(
            S,
            "path",
            "expected less than `melting_temperature`, <temperature>, instead of <temperature>",
            "Softening by heat begins above the melting point.",
            "Correct one of the two temperatures [K].",
        )
        .scene(&[METAL], "material.johnson_cook.transition_temperature"),
        entry(
            S,
            "path",
            "a heat source cannot be external; use an expression or a table in time, or make the heat flux \
             of a patch external",
            "Inputs from outside act on patches.",
            "Give the source in the scene, or heat through a patch.",
        )
        .scene(&[HEAT, r#"heat.source={"external": 0}"#], "heat.source"),
        entry(
            S,
            "path",
            "a body force cannot be external; use an expression or a table in time, or make the traction of \
             a patch external",
            "Inputs from outside act on patches.",
            "Give the force in the scene, or load a patch.",
        )
        .scene(&[r#"body_force={"external": [0, 0, 0]}"#], "body_force"),
    ]
}

fn numerics() -> Vec<Entry> {
    vec![
        entry(
            S,
            "path",
            "expected 6, 18, 26 or {\"radius\": r} instead of <count>",
            "A lattice has no such set of neighbours.",
            "Leave it out (18), or give one of these.",
        )
        .scene(&["numerics.neighbours=7"], "numerics.neighbours"),
        entry(
            S,
            "path",
            "expected a finite radius above 1 (in multiples of the spacing) instead of <radius>",
            "A radius of one spacing or less reaches no neighbour.",
            "Give a number such as 1.5; it is no length in metres.",
        )
        .scene(
            &[r#"numerics.neighbours={"radius": 1}"#],
            "numerics.neighbours.radius",
        ),
        entry(
            S,
            "path",
            "tributary weights belong to the operators `kernel`",
            "Repaired operators and those of the mesh have weights of their own.",
            "Leave `weights` or `operators` out.",
        )
        .scene(
            &[r#"numerics={"operators": "repaired", "weights": "tributary"}"#],
            "numerics.weights",
        ),
        entry(
            S,
            "path",
            "options 3 and 4 recompute kernels, and the operators `mesh` have none: set 1 or 2, or the operators \
             `repaired`",
            "An update of the reference cannot recompute kernels that are not there.",
            "Set `kernel_option` to 1 or 2, or choose other operators.",
        )
        .scene(
            &[r#"numerics={"operators": "mesh", "kernel_option": 3, "reference_update": "every_step"}"#],
            "numerics.kernel_option",
        ),
        entry(
            S,
            "path",
            "expected more than 0.5 (or the kernel does not reach its neighbours) and at most 2 instead of <value>",
            "The smoothing length is too small or too large for the neighbours that there are.",
            "Leave it out (0.6), or give a number in that range.",
        )
        .scene(&["numerics.smoothing_factor=0.5"], "numerics.smoothing_factor"),
        entry(
            S,
            "path",
            "expected 1, 2, 3 or 4 instead of <option>",
            "There are four ways in which kernels follow an updated reference.",
            "Leave it out, or give one of these.",
        )
        .scene(&["numerics.kernel_option=0"], "numerics.kernel_option"),
        entry(
            S,
            "path",
            "expected at least 1 step between updates instead of 0; `never` is total Lagrangian",
            "An update after every 0 steps is none.",
            "Give 1 or more, or `never`.",
        )
        .scene(
            &[r#"numerics.reference_update={"every": 0}"#],
            "numerics.reference_update.every",
        ),
        entry(
            S,
            "path",
            "expected more than 0 and less than 0.5 instead of <strain>",
            "The strain at which the reference is updated is out of its range: compression does not reach 0.5.",
            "Leave it out (0.2), or give a number in that range.",
        )
        .scene(
            &[r#"numerics.reference_update={"when": {"strain": 0.5}}"#],
            "numerics.reference_update.when.strain",
        ),
        entry(
            S,
            "path",
            "it acts on the volume equation, which needs `state` to be `fj` or `fhj`",
            "The volume is no unknown of this scene, so that nothing can be dissipated in it.",
            "Set `numerics.state`, or leave `volume_dissipation` out.",
        )
        .scene(&["numerics.volume_dissipation=0.1"], "numerics.volume_dissipation"),
        entry(
            S,
            "path",
            "expected more than 0 and at most 1 instead of <value>; `dissipation` set to false leaves D^p out",
            "The share of the Riemann dissipation is out of its range.",
            "Give a number in that range.",
        )
        .scene(
            &["numerics.dissipation_coefficient=0"],
            "numerics.dissipation_coefficient",
        ),
        entry(
            S,
            "path",
            "the dissipation is switched off; set `dissipation` to true or leave the coefficient out",
            "A coefficient is given for what is switched off.",
            "Decide for one of the two.",
        )
        .scene(
            &[r#"numerics={"dissipation": false, "dissipation_coefficient": 0.5}"#],
            "numerics.dissipation_coefficient",
        ),
        entry(
            S,
            "path",
            "expected 0 or more and less than 1 instead of <value>",
            "It is a share of the first stable step.",
            "Leave it out (0.001), or give 0 for no limit.",
        )
        .scene(&["numerics.smallest_step=1"], "numerics.smallest_step"),
        entry(
            S,
            "path",
            "expected 0 or more instead of <value>; 0 sets no limit",
            "It is what a step may strain a particle by.",
            "Leave it out (0.25), or give 0 for no limit.",
        )
        .scene(&["numerics.strain_increment=-1"], "numerics.strain_increment"),
        entry(
            S,
            "path",
            "a fixed step knows no limits; give `time_step` or `strain_increment`, not both",
            "The scene has a fixed step and a limit for it.",
            "Decide for one of the two.",
        )
        .scene(
            &[r#"numerics={"time_step": 1e-5, "strain_increment": 0.5}"#],
            "numerics.time_step",
        ),
        entry(
            S,
            "path",
            "a limiter needs `reconstruction` to be `linear`",
            "A reconstruction that is constant has nothing to be limited.",
            "Leave `limiter` out, or set `reconstruction` to `linear`.",
        )
        .scene(
            &[r#"numerics={"limiter": "minmod", "reconstruction": "none"}"#],
            "numerics.limiter",
        ),
        entry(
            S,
            "path",
            "a limiter acts on the dissipation, which is switched off; set `limiter` to `none` or `dissipation` to true",
            "A limiter is given for what is switched off.",
            "Decide for one of the two.",
        )
        .scene(
            &[r#"numerics={"limiter": "shock", "dissipation": false}"#],
            "numerics.limiter",
        ),
        entry(
            S,
            "path",
            "expected more than 0 and at most 2 instead of <cfl>",
            "No step is stable with such a CFL number, or none is made.",
            "Leave it out: the default is the largest that is proven stable.",
        )
        .scene(&["numerics.cfl=2.5"], "numerics.cfl"),
        entry(
            S,
            "path",
            "a fixed step replaces the CFL condition; give `time_step` or `cfl`, not both",
            "Both say how large a step is.",
            "Leave one of them out.",
        )
        .scene(
            &[r#"numerics={"time_step": 1e-5, "cfl": 0.5}"#],
            "numerics.time_step",
        ),
        entry(
            S,
            "path",
            "single precision does not hold the numbers that this body makes: <what> is <size>; leave this out, \
             or set \"double\"",
            "In single precision numbers end near 1e38: the units or the sizes of this scene are extreme.",
            "Use double precision, or other units.",
        )
        .scene(
            &["numerics.precision=single", "material.neo_hookean.youngs_modulus=1e39"],
            "numerics.precision",
        ),
    ]
}

fn conditions() -> Vec<Entry> {
    vec![
        entry(
            S,
            "path boundary",
            "a patch has either a `support` or a prescribed `velocity`, not both",
            "Both say how the patch moves.",
            "Leave one out; a component of `velocity` that is null is free.",
        )
        .scene(
            &["boundary.y_min.support=clamped", "boundary.y_min.velocity=[0, 0, 0]"],
            "boundary.y_min",
        ),
        entry(
            S,
            "path boundary",
            "<rule>, but this is <value>",
            "A temperature or a coefficient that the scene gives is impossible.",
            "Give temperatures in kelvin and coefficients from 0.",
        )
        .variants(&[
            "a heat transfer coefficient is not negative",
            "an absolute temperature is above 0 K",
        ])
        .scene(
            &[HEAT, "boundary.y_max.temperature=0"],
            "boundary.y_max.temperature",
        )
        .scene(
            &[HEAT, r#"boundary.y_max.convection={"coefficient": -1, "ambient_temperature": 300}"#],
            "boundary.y_max.convection.coefficient",
        ),
        entry(
            S,
            "path boundary",
            "a patch has either a prescribed `temperature` or a `<key>`, not both: the temperature settles how \
             much heat flows",
            "Heat that flows into what is held at a temperature has no effect.",
            "Leave one out.",
        )
        .scene(
            &[HEAT, "boundary.y_max.temperature=300", "boundary.y_max.heat_flux=1"],
            "boundary.y_max.heat_flux",
        ),
        entry(
            S,
            "path boundary?",
            "`null` (a free component) is only for the prescribed velocity of a boundary; write 0",
            "A load or an initial value has all three components.",
            "Write 0 instead of null.",
        )
        .scene(
            &["boundary.y_max.traction=[0, null, 0]"],
            "boundary.y_max.traction[1]",
        ),
        entry(
            S,
            "path",
            "there is no patch `<name>`; there are <patches>",
            "The scene speaks of a patch that neither its geometry nor its section `patches` has.",
            "Use a name of the list, or add the patch to `patches`.",
        )
        .scene(&["boundary.lid.support=clamped"], "boundary.lid")
        .scene(
            &[r#"contact.floor={"point": [0, 0, 0], "normal": [0, 1, 0], "patch": "lid"}"#],
            "contact.floor.patch",
        ),
        entry(
            S,
            "path boundary",
            "a condition for heat needs the section `heat`, which switches heat on",
            "The body has no temperature.",
            "Add the section `heat`, or leave the condition out.",
        )
        .scene(&["boundary.y_max.heat_flux=1"], "boundary.y_max.heat_flux"),
        entry(
            S,
            "path boundary",
            "selects no particle; the body's patches are <patches>",
            "A patch of the geometry has no exposed face: another box covers it.",
            "Use another patch, or leave the condition out.",
        )
        .scene(
            &[crate::TWO_BOXES, r#"boundary["a.x_max"].support=clamped"#],
            "boundary.a.x_max",
        ),
        entry(
            S,
            "path",
            "the patch `<name>` selects no particle",
            "A patch of the geometry has no exposed face: another box covers it.",
            "Use another patch, or leave `patch` out: the plane then acts on the whole body.",
        )
        .scene(
            &[
                crate::TWO_BOXES,
                r#"contact={"floor": {"point": [-1, 0, 0], "normal": [1, 0, 0], "patch": "a.x_max"}}"#,
            ],
            "contact.floor.patch",
        ),
        entry(
            S,
            "path boundary particle position",
            "a particle lies on the patches `<name>` and `<name>`, and both set the same component of its velocity: \
             leave that component free in one of them (null in `velocity`), or select patches that do not overlap",
            "Two conditions contradict each other on an edge.",
            "Free the component in one of them, or cut one patch with `min` and `max`.",
        )
        .scene(
            &["boundary.y_min.support=clamped", "boundary.x_min.velocity=[0, 1, 0]"],
            "boundary.y_min",
        ),
        entry(
            S,
            "path boundary particle position",
            "a particle lies on the patches `<name>` and `<name>`, and both prescribe its temperature: select patches \
             that do not overlap, or give both the same temperature",
            "Two conditions contradict each other on an edge.",
            "Give both the same temperature, or cut one patch with `min` and `max`.",
        )
        .scene(
            &[HEAT, "boundary.y_max.temperature=300", "boundary.x_max.temperature=301"],
            "boundary.y_max.temperature",
        ),
        entry(
            S,
            "path boundary? field? particle position? time?",
            "the value is not finite here: check the expression for this place and time",
            "An expression divides by zero or overflows at the particle and the time that are named.",
            "Correct it, or cut the singular place out with `min(..)`, `max(..)` or `heaviside(..)`.",
        )
        .scene(&[r#"body_force=["1/(X-0.25)", 0, 0]"#], "body_force")
        .scene(
            &[r#"boundary.y_max.pressure="1/(X-0.25)""#],
            "boundary.y_max.pressure",
        ),
        entry(
            S,
            "path boundary field particle position time",
            "the value is <value> here, but <rule>: check the expression for this place and time",
            "An expression gives an impossible temperature or coefficient at the particle and the time that are named.",
            "Correct it, or bound it with `max(..)`.",
        )
        .scene(
            &[HEAT, r#"boundary.y_max.temperature="300-400*X""#],
            "boundary.y_max.temperature",
        ),
    ]
}

fn planes() -> Vec<Entry> {
    vec![
        entry(
            S,
            "path",
            "a normal has a direction: give three numbers that are not all 0",
            "The plane has no orientation.",
            "Give a vector from the plane towards the body, of any length.",
        )
        .scene(
            &[r#"contact.floor={"point": [0, 0, 0], "normal": [0, 0, 0]}"#],
            "contact.floor.normal",
        ),
        entry(
            S,
            "path",
            "a plane cannot be driven from outside: give a number, an expression in t or a table",
            "Inputs from outside act on patches.",
            "Give the plane's velocity in the scene, or drive a patch.",
        )
        .scene(
            &[r#"contact.floor={"point": [0, 0, 0], "normal": [0, 1, 0], "velocity": {"external": 0}}"#],
            "contact.floor.velocity",
        ),
        entry(
            S,
            "path",
            "a rigid plane has one velocity: the expression may depend on t only",
            "The velocity differs from place to place, so that the plane would not stay one.",
            "Leave X, Y and Z out.",
        )
        .scene(
            &[r#"contact.floor={"point": [0, 0, 0], "normal": [0, 1, 0], "velocity": "X"}"#],
            "contact.floor.velocity",
        ),
        entry(
            S,
            "path particle position",
            "a particle starts <depth> m behind the plane: move its `point`, turn its `normal` towards the body, or \
             give the `patch` that it acts on",
            "The body is not on the side of the plane that its normal points to.",
            "Move or turn the plane.",
        )
        .scene(
            &[r#"contact.floor={"point": [0, 0.1, 0], "normal": [0, 1, 0]}"#],
            "contact.floor",
        ),
        entry(
            S,
            "path time",
            "the value is not finite at this time: check the expression",
            "The velocity of a plane divides by zero or overflows at the time that is named.",
            "Correct the expression.",
        )
        .scene(
            &[r#"contact.floor={"point": [0, 0, 0], "normal": [0, 1, 0], "velocity": "1/t"}"#],
            "contact.floor.velocity",
        ),
    ]
}

fn initial() -> Vec<Entry> {
    vec![
        entry(
            S,
            "path",
            "there is no initial displacement that has a gradient: add `initial.displacement`",
            "The gradient of what is not there was asked for.",
            "Add the displacement, or leave `gradient` out.",
        )
        .scene(&["initial.gradient=exact"], "initial.gradient"),
        entry(
            S,
            "path",
            "an initial temperature is a number or an expression in X, Y and Z",
            "A table or an input from outside has no place at the start.",
            "Give a number or an expression.",
        )
        .scene(
            &[HEAT, r#"initial.temperature={"external": 300}"#],
            "initial.temperature",
        ),
        entry(
            S,
            "path",
            "an initial value cannot depend on t: use X, Y and Z only",
            "The start is one time.",
            "Leave t out.",
        )
        .scene(&["initial.velocity=[0, \"t\", 0]"], "initial.velocity[1]")
        .scene(&[HEAT, "initial.temperature=300+t"], "initial.temperature"),
        entry(
            S,
            "path",
            "an initial value has three components, each a number or an expression in X, Y and Z",
            "A table or an input from outside has no place at the start.",
            "Give a list of three numbers or expressions.",
        )
        .scene(
            &[r#"initial.velocity={"external": [0, 0, 0]}"#],
            "initial.velocity",
        )
        .scene(
            &[r#"initial.velocity=[0, 0, {"table": {"time": [0], "value": [1]}}]"#],
            "initial.velocity[2]",
        ),
        entry(
            S,
            "path",
            "the body has no temperature: add a section `heat`",
            "An initial temperature is given to a body without heat.",
            "Add the section `heat`, or leave the temperature out.",
        )
        .scene(&["initial.temperature=300"], "initial.temperature"),
        entry(
            S,
            "path particle position",
            "the value is not finite here: check the expression",
            "An initial value divides by zero or overflows at the particle that is named.",
            "Correct the expression.",
        )
        .scene(
            &[r#"initial.velocity=["ln(X-0.5)", 0, 0]"#],
            "initial.velocity",
        )
        .scene(
            &[r#"initial={"displacement": ["sqrt(X)", 0, 0], "gradient": "exact"}"#],
            "initial.displacement",
        ),
        entry(
            S,
            "path particle position",
            "the absolute temperature is <temperature> K here, not above 0",
            "The initial temperature is impossible at the particle that is named, perhaps given in degrees Celsius.",
            "Give temperatures in kelvin.",
        )
        .scene(&[HEAT, "initial.temperature=300-400*X"], "initial.temperature"),
        entry(
            S,
            "path particle position",
            "a particle is inverted or moves at a speed that is not finite from the start: check the displacement \
             and the velocity",
            "The initial displacement folds the body at the particle that is named.",
            "Reduce the displacement or its gradient.",
        )
        .scene(&[r#"initial.displacement=["-3*X", 0, 0]"#], "initial"),
    ]
}

fn names() -> Vec<Entry> {
    vec![
        entry(
            S,
            "path",
            "`<name>` is the name of a face already; choose another",
            "A patch would hide a face of the geometry.",
            "Rename the patch.",
        )
        .scene(&[r#"patches.x_min.faces=["x_min"]"#], "patches.x_min"),
        entry(
            S,
            "path",
            "`<name>` is not a name: a name starts with a letter (a-z, A-Z) and goes on with letters, digits, `_` and `-`",
            "Names become columns of the history and variables of an FMU.",
            "Rename it.",
        )
        .scene(&[r#"patches.1st.faces=["x_min"]"#], "patches.1st")
        .scene(&["probes.top centre=[0, 0, 0]"], "probes.top centre"),
        entry(
            S,
            "path particle? position?",
            "the probe lies outside the body: give a point inside it, in the initial configuration<nearest>",
            "A probe is a point of the body; its position is that of the start.",
            "Move it inside; particle and position of an error name the nearest particle.",
        )
        .variants(&[
            "the probe lies outside the body: give a point inside it, in the initial configuration; the nearest \
             particle is named here",
        ])
        .scene(&["probes.far=[9, 9, 9]"], "probes.far")
        .scene(
            &[
                r#"geometry={"cylinder": {"radius": 1, "length": 2, "divisions": 2, "layers": 4, "sector": "full"}}"#,
                "probes.far=[9, 9, 9]",
            ],
            "probes.far",
        ),
        entry(
            S,
            "path",
            "there is no field `<name>`; there are <fields>",
            "No field has this name.",
            "Use a name of the list.",
        )
        .scene(&[r#"output.fields=["colour"]"#], "output.fields[0]"),
        entry(
            S,
            "path",
            "the field `<name>` is listed twice: remove one",
            "A field file has each field once.",
            "Remove one of the two.",
        )
        .scene(&[r#"output.fields=["velocity", "velocity"]"#], "output.fields[1]"),
        entry(
            S,
            "path field",
            "<remedy of the field>",
            "A field file is to have a field that this body does not have: a temperature or a plastic strain.",
            "Leave the field out, or give the body what the message names.",
        )
        .variants(&[
            "the body has no temperature: add a section `heat` to the scene",
            "the material has no plastic strain: choose a material with plasticity",
        ])
        .call("a temperature without heat", || {
            let simulation = crate::common::block(&[r#"output.fields=["temperature"]"#]);
            urlsph::output::variables::selected_fields(&simulation)
        })
        .call("a plastic strain without plasticity", || {
            let simulation = crate::common::block(&[r#"output.fields=["equivalent_plastic_strain"]"#]);
            urlsph::output::variables::selected_fields(&simulation)
        }),
    ]
}
