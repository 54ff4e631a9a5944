// A mass-spring oscillator that shakes a rubber column at its bottom: the column's support force acts
// back on the mass. Two programs exchange force and velocity in every communication step, which is
// the usual way of a partitioned coupling.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include <urlsph.hpp>

namespace {

const char* const scene = R"({
  "title": "Shaken column",
  "geometry": { "box": { "min": [-0.5, 0, -0.5], "max": [0.5, 2, 0.5], "spacing": 0.25 } },
  "material": {
    "neo_hookean": { "density": 1100, "youngs_modulus": 1.7e7, "poisson_ratio": 0.3 }
  },
  "boundary": { "y_min": { "velocity": { "external": [0, 0, 0] } } },
  "probes": { "top": [0, 2, 0] },
  "time": { "end": 0.05 }
})";

// A mass [kg] on a spring [N/m], moving along x; semi-implicit Euler.
struct Oscillator {
    double mass = 2e4;
    double stiffness = 2e7;
    double displacement = 0.02;
    double velocity = 0.0;

    void step(double dt, double force) {
        velocity += dt * (force - stiffness * displacement) / mass;
        displacement += dt * velocity;
    }
};

}  // namespace

int main() try {
    urlsph::Simulation column = urlsph::Simulation::from_json(scene);
    const std::size_t support = column.patch("y_min");
    const std::size_t top = column.probe("top");

    unsigned long steps = 0;
    urlsph::Callbacks callbacks;
    callbacks.progress = [&](const urlsph_progress&) { ++steps; };
    column.set_callbacks(std::move(callbacks));

    Oscillator oscillator;
    const double dt = 5e-4;
    std::printf("%10s %16s %16s\n", "time [s]", "support [m]", "top [m]");
    for (int i = 1; column.time() < column.end_time(); ++i) {
        // The column feels the support, the support feels the column.
        const urlsph_resultant reaction = column.resultant(support);
        oscillator.step(dt, -reaction.force[0]);
        column.set_velocity(support, {oscillator.velocity, 0.0, 0.0});
        column.advance_to(std::min(i * dt, column.end_time()));
        if (i % 10 == 0) {
            std::printf("%10.4f %16.6f %16.6f\n", column.time(),
                        column.resultant(support).mean_displacement[0],
                        column.probe_motion(top).displacement[0]);
        }
    }
    std::printf("%lu time steps, ledger closes to %g J\n", steps,
                column.energies().closure_error);
    return std::isfinite(oscillator.displacement) ? 0 : 1;
} catch (const urlsph::Error& error) {
    std::fprintf(stderr, "error: %s\n", error.what());
    return error.code();
}
