//! One right-hand side and one time step: time per directed neighbour pair (`Throughput::Elements`).
//!
//! A column at the start of a twist: 17 x 97 x 17 particles, or 9 x 49 x 9. `cargo bench --bench step`.

#[path = "column/mod.rs"]
mod column;

use std::hint::black_box;

use criterion::measurement::WallTime;
use criterion::{
    BenchmarkGroup, BenchmarkId, Criterion, Throughput, criterion_group, criterion_main,
};
use urlsph::Simulation;

use column::{HEAT, JITTER, JOHNSON_COOK, VON_MISES};

/// The twisted column after a few steps, at a spacing.
fn twisted(spacing: f64, threads: usize, overrides: &[&str]) -> Simulation {
    let scene = column::scene(spacing, overrides).expect("the example is a scene");
    let mut simulation = Simulation::with_threads(scene, threads).expect("it can be set up");
    let few = 5.0 * simulation.stable_step();
    simulation.advance(few).expect("it runs");
    simulation
}

fn right_hand_side(c: &mut Criterion) {
    let mut group = c.benchmark_group("right-hand side, 28,033 particles");
    let cases: [(&str, &[&str]); 4] = [
        ("elastic", &[]),
        ("with heat", &[HEAT]),
        ("von Mises", &[VON_MISES]),
        ("Johnson-Cook with heat", &[JOHNSON_COOK, HEAT]),
    ];
    for ((name, overrides), threads) in cases.iter().flat_map(|c| [(c, 1), (c, 2)]) {
        let mut simulation = twisted(0.0625, threads, overrides);
        group.throughput(Throughput::Elements(simulation.pair_count() as u64));
        group.bench_function(BenchmarkId::new(*name, threads), |b| {
            b.iter(|| black_box(simulation.evaluate()));
        });
        println!(
            "{} bytes per particle",
            simulation.memory() / simulation.particle_count()
        );
    }
    group.finish();
}

/// What an option costs where it is on; where it is off it costs nothing, since the loops are
/// compiled without it.
fn options(c: &mut Criterion) {
    let cases: &[(&str, &[&str])] = &[
        ("default", &[]),
        ("without dissipation", &["numerics.dissipation=false"]),
        ("first order", &["numerics.reconstruction=none"]),
        ("single precision", &["numerics.precision=single"]),
        ("minmod", &["numerics.limiter=minmod"]),
        ("shock", &["numerics.limiter=shock"]),
        ("venkatakrishnan", &["numerics.limiter=venkatakrishnan"]),
        ("state {f, j}", &["numerics.state=fj"]),
        ("state {f, h, j}", &["numerics.state=fhj"]),
        (
            "D^j",
            &["numerics.state=fj", "numerics.volume_dissipation=0.05"],
        ),
        (
            "angular-momentum projection",
            &["numerics.angular_momentum_projection=true"],
        ),
        (
            "update every step, option 1",
            &["numerics.reference_update=every_step"],
        ),
        (
            "update every step, option 2",
            &[
                "numerics.reference_update=every_step",
                "numerics.kernel_option=2",
            ],
        ),
        (
            "update every step, option 3",
            &[
                "numerics.reference_update=every_step",
                "numerics.kernel_option=3",
            ],
        ),
        (
            "update every step, option 4",
            &[
                "numerics.reference_update=every_step",
                "numerics.kernel_option=4",
            ],
        ),
        (
            "20 % jitter, operators of the kernel",
            &[JITTER, "numerics.operators=kernel"],
        ),
        ("20 % jitter, repaired", &[JITTER]),
        (
            "20 % jitter, repaired, update every step, option 3",
            &[
                JITTER,
                "numerics.reference_update=every_step",
                "numerics.kernel_option=3",
            ],
        ),
        (
            "20 % jitter, operators of the mesh, 26 neighbours",
            &[JITTER, "numerics.operators=mesh", "numerics.neighbours=26"],
        ),
        ("26 neighbours", &["numerics.neighbours=26"]),
        ("6 neighbours", &["numerics.neighbours=6"]),
        ("heat", &[HEAT]),
        ("von Mises plasticity", &[VON_MISES]),
        ("Johnson-Cook plasticity and heat", &[JOHNSON_COOK, HEAT]),
    ];
    let mut group = c.benchmark_group("step, 3,969 particles, 1 thread");
    for (name, overrides) in cases {
        steps(
            &mut group,
            BenchmarkId::from_parameter(name),
            twisted(0.125, 1, overrides),
        );
    }
    group.finish();
}

/// Whole steps of a larger body.
fn threads(c: &mut Criterion) {
    let mut group = c.benchmark_group("step, 28,033 particles");
    for threads in [1, 2] {
        steps(
            &mut group,
            BenchmarkId::new("threads", threads),
            twisted(0.0625, threads, &[]),
        );
    }
    group.finish();
}

fn steps(group: &mut BenchmarkGroup<'_, WallTime>, id: BenchmarkId, mut simulation: Simulation) {
    // Three right-hand sides a step.
    group.throughput(Throughput::Elements(3 * simulation.pair_count() as u64));
    let dt = 1e-3 * simulation.stable_step();
    group.bench_function(id, |b| {
        b.iter(|| {
            simulation
                .advance(simulation.time() + dt)
                .expect("a short step")
        });
    });
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(20);
    targets = right_hand_side, threads, options
}
criterion_main!(benches);
