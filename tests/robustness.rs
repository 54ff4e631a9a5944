//! What must stay whole when something goes wrong, and geometries that invite silent errors.
#![allow(missing_docs)]

mod common;

use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;
use urlsph::{Code, Field, Quantity, Snapshot};

use common::{BLOCK, block, field, refuses};

/// Two boxes around a slit one spacing wide, joined at the foot.
const FORK: &str = r#"geometry={"boxes": {
    "foot": {"min": [0, 0, 0], "max": [3, 1, 1], "spacing": 0.5},
    "left": {"min": [0, 1, 0], "max": [1, 3, 1], "spacing": 0.5},
    "right": {"min": [1.5, 1, 0], "max": [3, 3, 1], "spacing": 0.5}
}}"#;

#[test]
fn neighbours_do_not_reach_across_a_gap() {
    let s = block(&[FORK, r#"numerics.neighbours={"radius": 2.1}"#]);
    // The legs moved apart: with bonds across the slit the forces would not be zero.
    let pull = r#"initial.displacement=["0.01*heaviside(X-1.25)*heaviside(Y-1.75)", 0, 0]"#;
    let moved = block(&[FORK, r#"numerics.neighbours={"radius": 2.1}"#, pull]);
    let x = field(&moved, Field::InitialPosition);
    let force = field(&moved, Field::NodalForce);
    let mut tips = 0;
    for i in 0..moved.particle_count() {
        // Out of the reach of the moved layer's lower end.
        if x[3 * i] <= 1.0 && x[3 * i + 1] > 2.9 {
            tips += 1;
            let size = force[3 * i..3 * i + 3]
                .iter()
                .map(|f| f * f)
                .sum::<f64>()
                .sqrt();
            assert!(size < 1e-6, "force {size:e} N on the left tip");
        }
    }
    assert!(tips > 0 && s.pair_count() == moved.pair_count());
}

/// A face belongs to every box on whose bound it lies, whatever the names are.
#[test]
fn faces_of_overlapping_boxes_are_whole() {
    for (first, second) in [("a", "b"), ("b", "a")] {
        let geometry = format!(
            r#"geometry={{"boxes": {{
                "{first}": {{"min": [0, 0, 0], "max": [2, 1, 1], "spacing": 0.5}},
                "{second}": {{"min": [1, 0, 0], "max": [3, 1, 1], "spacing": 0.5}}
            }}}}"#
        );
        let s = block(&[&geometry]);
        for name in [first, second] {
            let patch = s.patch_index(&format!("{name}.y_max")).expect("there");
            let area: f64 = s.patches()[patch].areas.iter().sum();
            assert!((area - 2.0).abs() < 1e-12, "{name}: {area}");
        }
        let volume: f64 = field(&s, Field::InitialVolume).iter().sum();
        assert!((volume - 3.0).abs() < 1e-12);
    }
}

#[test]
fn a_jump_of_the_spacing_is_refused() {
    let jump = r#"geometry={"boxes": {
        "a": {"min": [0, 0, 0], "max": [2, 1, 1], "spacing": 0.5},
        "b": {"min": [2, 0, 0], "max": [4, 1, 1], "spacing": 0.25}
    }}"#;
    refuses(BLOCK, &[jump], "geometry.boxes", "along x");
}

/// A spacing that differs per axis is no jump.
#[test]
fn anisotropic_spacing_runs() {
    let mut s = block(&[
        "geometry.box.spacing=[0.125, 0.25, 0.5]",
        r#"initial.velocity=[0, "Y", 0]"#,
    ]);
    s.advance(0.05).expect("it runs");
}

#[test]
fn the_default_step_follows_the_neighbours_that_there_are() {
    let six = block(&[r#"numerics.neighbours={"radius": 1.2}"#]);
    assert_eq!(
        six.pair_count(),
        block(&["numerics.neighbours=6"]).pair_count()
    );
    assert_eq!((six.cfl_number(), block(&[]).cfl_number()), (0.45, 0.9));
}

/// A step strains and turns no particle by more than the scene allows.
#[test]
fn violent_flow_shortens_the_step() {
    let rates = [
        (r#"["1000*X", 0, 0]"#, 1000.0),
        // Twice as thick: the same jumps over twice the distance.
        (r#"["1000*X", 0, 0]"#, 500.0),
        (r#"["-1000*Y", "1000*X", 0]"#, 1000.0 * 2.0_f64.sqrt()),
    ];
    for (k, (velocity, rate)) in rates.into_iter().enumerate() {
        let stretch = f64::from(k == 1);
        let start = |own: &str| {
            block(&[
                &format!("initial.velocity={velocity}"),
                &format!(r#"initial.displacement=["{stretch}*X", 0, 0]"#),
                own,
            ])
        };
        for (own, increment) in [
            ("title=none", 0.25),
            ("numerics.strain_increment=0.02", 0.02),
        ] {
            let residual = start(own).stable_step() * rate / increment - 1.0;
            println!("{velocity}: residual {residual:.1e}, tolerance 1e-12");
            assert!(residual.abs() < 1e-12);
        }
        let (calm, free) = (block(&[]), start("numerics.strain_increment=0"));
        assert!(free.stable_step() > 0.5 * calm.stable_step());
    }
}

/// Behind an impact at twice the speed of shear waves and more the CFL condition alone allows a step that
/// turns particles inside out.
#[test]
fn impacts_beyond_the_speed_of_sound_run() {
    for speed in [150, 300] {
        let cube = |own: &str| {
            block(&[
                r#"geometry={"box": {"min": [0, 0, 0], "max": [1, 1, 1], "spacing": 0.125}}"#,
                r#"material={"neo_hookean": {"density": 1100, "youngs_modulus": 1.7e7, "poisson_ratio": 0.3}}"#,
                r#"contact={"wall": {"point": [0, 0, 0], "normal": [0, 0, 1]}}"#,
                &format!("initial.velocity=[0, 0, -{speed}]"),
                own,
            ])
        };
        let mut free = cube("numerics.strain_increment=0");
        let error = free.advance(0.02).expect_err("inside out");
        assert_eq!(
            (error.code(), free.time()),
            (Code::Diverged, 0.0),
            "{error}"
        );
        let mut bounded = cube("title=the default");
        let e0 = bounded.energies().kinetic;
        bounded.advance(0.02).expect("it runs");
        let closure = bounded.energies().closure_error / e0;
        println!("{speed} m/s: error of the ledger {closure:.1e} of the energy, tolerance 5e-3");
        assert!(closure.abs() < 5e-3);
    }
}

/// All work is done in the pool of the simulation: rayon's global pool, whose threads a host could not get rid of,
/// is never started, not even to find out why a step has become too small.
#[test]
fn the_global_pool_is_left_alone() {
    let mut s = block(&[
        "numerics.smallest_step=0.5",
        "numerics.reference_update=every_step",
        "boundary.y_min.support=roller",
        "boundary.y_max.velocity=[null, -1, null]",
    ]);
    let error = s.advance(1.9).expect_err("pressed flat");
    assert!(
        error.message().contains("the stable step fell to"),
        "{error}"
    );
    for of in [Field::CauchyStress, Field::Pressure, Field::Velocity] {
        field(&s, of);
    }
    let _ = (s.energies(), s.momenta(), s.state_hash());
    s.restore(&s.snapshot()).expect("its own");
    let global = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build_global();
    global.expect("the first to start it");
}

/// A prescribed velocity needs a value at its own time only.
#[test]
fn prescribed_velocities_with_singular_ends() {
    let mut s = block(&[r#"boundary.y_min.velocity=[0, "sqrt(t)", 0]"#]);
    s.advance(0.1).expect("it runs");
    let mut s = block(&[r#"boundary.y_min.velocity=[0, "sqrt(0.1-t)", 0]"#]);
    s.advance(0.1).expect("to the last value");
    let error = s.advance(0.2).expect_err("no value any more");
    println!("{error}");
    assert_eq!((error.code(), s.time()), (Code::InvalidScene, 0.1));
    // A ramp from the start: the inertia of the face is there at once, not half of it.
    let s = block(&[
        r#"boundary.y_min.velocity={"table": {"time": [0, 1], "value": [[0,0,0], [0,2,0]]}}"#,
    ]);
    let force = s.resultant(s.patch_index("y_min").expect("there")).force[1];
    let mass = 1000.0 * 0.125;
    println!("force {force} N for {mass} kg at 2 m/s^2");
    assert!((force / (2.0 * mass) - 1.0).abs() < 1e-9);
}

/// The projection starts afresh after a step that was given up.
#[test]
fn a_body_recovers_from_a_load_that_broke_it() {
    let mut s = block(&[
        "boundary.y_min.support=clamped",
        r#"boundary.y_max.traction={"external": [0, 0, 0]}"#,
        "numerics.angular_momentum_projection=true",
    ]);
    let top = s.patch_index("y_max").expect("there");
    s.advance(0.01).expect("it runs");
    let hash = s.state_hash();
    for bad in [1e12, 1e200, 1e308] {
        s.set_input(top, Quantity::Traction, &[0.0, bad, 0.0])
            .expect("finite");
        let error = s.advance(0.02).expect_err("far too much");
        assert_eq!(error.code(), Code::Diverged, "{error}");
        s.set_input(top, Quantity::Traction, &[0.0; 3])
            .expect("finite");
        assert_eq!(s.state_hash(), hash, "the last good state");
    }
    s.advance(0.02).expect("nothing is left of it");
    assert!(s.energies().kinetic.is_finite());
}

/// An impulse that breaks the body at once is taken back.
#[test]
fn an_impulse_without_a_step_is_taken_back() {
    let mut s = block(&[r#"boundary.y_min.velocity={"external": [0, 0, 0]}"#]);
    let bottom = s.patch_index("y_min").expect("there");
    s.advance(0.01).expect("it runs");
    let hash = s.state_hash();
    for bad in [1e6, 1.2e154, 1e160] {
        s.set_input(bottom, Quantity::Velocity, &[0.0, bad, 0.0])
            .expect("finite");
        let error = s.advance(0.02).expect_err("far too much");
        assert_eq!(error.code(), Code::Diverged, "{error}");
        s.set_input(bottom, Quantity::Velocity, &[0.0; 3])
            .expect("finite");
        assert_eq!(s.state_hash(), hash, "the last good state");
    }
    s.advance(0.02).expect("nothing is left of it");
}

/// With independent j and updates every step a breakdown leaves the reference as it was.
#[test]
fn a_breakdown_keeps_the_reference() {
    for option in 1..=4 {
        let option = format!("numerics.kernel_option={option}");
        let mut s = block(&[
            "numerics.state=fj",
            "numerics.reference_update=every_step",
            &option,
            "material.neo_hookean.poisson_ratio=0.49",
            r#"boundary.y_max.traction={"external": [0, 0, 0]}"#,
        ]);
        let top = s.patch_index("y_max").expect("there");
        s.set_input(top, Quantity::Traction, &[1e6, -8e6, 3e5])
            .expect("finite");
        let mut last = s.snapshot();
        let error = loop {
            let next = s.time() + s.stable_step();
            match s.advance(next) {
                Ok(()) => last = s.snapshot(),
                Err(error) => break error,
            }
            assert!(s.time() < 1.0, "it ought to break");
        };
        println!("{option}: {error}");
        assert_eq!(error.code(), Code::Diverged);
        assert_eq!(s.state_hash(), last.hash());
        s.set_input(top, Quantity::Traction, &[0.0; 3])
            .expect("finite");
        assert!(field(&s, Field::Jacobian).iter().all(|j| *j > 0.0));
    }
}

/// Calls of exactly one fixed step make one step each.
#[test]
fn fixed_steps_are_not_split_by_round_off() {
    let mut s = block(&["numerics.time_step=1e-4", r#"initial.velocity=[0, "Y", 0]"#]);
    for i in 1..=300 {
        s.advance(1e-4 * f64::from(i)).expect("it runs");
    }
    assert_eq!(s.steps(), 300);
}

/// A snapshot goes to another run of the scene that lasts longer or writes something else.
#[test]
fn a_snapshot_outlives_what_a_run_writes() {
    let mut s = block(&[r#"initial.velocity=[0, "Y", 0]"#]);
    s.advance(0.01).expect("it runs");
    let bytes = s.snapshot().to_bytes();
    let mut longer = block(&[
        r#"initial.velocity=[0, "Y", 0]"#,
        "time.end=5",
        "title=again",
        "probes.here=[0, 0, 0]",
        "output.history_interval=0.1",
    ]);
    let snapshot = Snapshot::from_bytes(&bytes).expect("our own");
    longer.restore(&snapshot).expect("the same body");
    assert_eq!(longer.state_hash(), s.state_hash());
    let mut other = block(&["material.neo_hookean.poisson_ratio=0.2"]);
    let hash = other.state_hash();
    let error = other.restore(&snapshot).expect_err("another material");
    assert_eq!((error.code(), other.state_hash()), (Code::Snapshot, hash));
    for damaged in [
        &bytes[..bytes.len() - 9],
        &[&bytes[..40], &[1], &bytes[41..]].concat()[..],
        &[],
    ] {
        assert_eq!(
            Snapshot::from_bytes(damaged).expect_err("damaged").code(),
            Code::Snapshot
        );
    }
}

/// A host's own pool of threads runs many bodies side by side, and none of them inside another.
#[test]
fn many_bodies_run_in_a_pool_of_the_host() {
    let depth = AtomicUsize::new(0);
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("a pool");
    let hashes: Vec<u64> = pool.install(|| {
        let one = |_| {
            let within = depth.fetch_add(1, Ordering::Relaxed);
            let mut simulation = block(&[]);
            simulation
                .advance(3.0 * simulation.stable_step())
                .expect("stable");
            depth.fetch_sub(1, Ordering::Relaxed);
            assert_eq!(within, 0, "one body runs inside another");
            simulation.state_hash()
        };
        (0..20).into_par_iter().with_max_len(1).map(one).collect()
    });
    assert!(hashes.iter().all(|hash| *hash == hashes[0]));
}
