// A membrane with mass on a rubber pad: an external structural model pushes on a patch of the body,
// particle by particle, and follows its displacement. See README.md.
//
// Implicit coupling: every communication step is repeated from a snapshot until both sides agree. The
// unknowns are the tractions q of the step; the body answers with displacements, the membrane with
// the tractions that these take, S(q). The fixed point q = S(q) is sought with Aitken's relaxation.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numeric>
#include <vector>

#include <urlsph.hpp>

#include "membrane.hpp"

namespace {

const char* const scene = R"({
  "title": "Rubber pad under a membrane",
  "geometry": { "box": { "min": [0, 0, 0], "max": [0.2, 0.1, 0.2], "spacing": 0.025 } },
  "material": {
    "neo_hookean": { "density": 1100, "youngs_modulus": 1.7e7, "poisson_ratio": 0.3 }
  },
  "boundary": {
    "y_min": { "support": "clamped" },
    "y_max": { "traction": { "external": [0, 0, 0], "per_particle": true } }
  },
  "time": { "end": 0.004 }
})";

constexpr double tension = 2e3;     // [N/m]
constexpr double tolerance = 1e-8;  // of |S(q) - q| over the largest |q| so far
constexpr int most_iterations = 60;

using Values = std::vector<double>;

double norm(const Values& a) {
    return std::sqrt(std::inner_product(a.begin(), a.end(), a.begin(), 0.0));
}

// The body with what the coupling needs of it.
class Pad {
public:
    Pad() : body_(urlsph::Simulation::from_json(scene)), top_(body_.patch("y_max")) {
        particles_ = body_.patch_particles(top_);
        displacement_ = body_.field("displacement");
    }
    urlsph::Simulation& body() { return body_; }
    Values areas() const { return body_.patch_areas(top_); }
    // Initial positions of the nodes, x 3.
    Values nodes() const { return gather(body_.read_field("initial_position"), 0, 3); }
    // Deflections along y of the nodes.
    Values deflections() const { return gather(body_.read_field(displacement_), 1, 1); }
    // Tractions along y, one per node.
    void push(const Values& q) {
        Values tractions(3 * q.size(), 0.0);
        for (std::size_t i = 0; i < q.size(); ++i) tractions[3 * i + 1] = q[i];
        body_.set_traction(top_, tractions);
    }

private:
    Values gather(const Values& field, std::size_t first, std::size_t count) const {
        Values values;
        for (std::size_t p : particles_) {
            for (std::size_t c = 0; c < count; ++c) values.push_back(field[3 * p + first + c]);
        }
        return values;
    }
    urlsph::Simulation body_;
    std::size_t top_, displacement_ = 0;
    std::vector<std::size_t> particles_;
};

// A membrane on the nodes of the pad: links between nodes that are one spacing apart.
Membrane membrane_on(const Pad& pad, double mass) {
    const Values x = pad.nodes(), areas = pad.areas();
    const double spacing = 0.025;
    Membrane m{mass, tension, areas, {}, {}, Values(areas.size()), Values(areas.size())};
    for (std::size_t i = 0; i < areas.size(); ++i) {
        for (std::size_t j = i + 1; j < areas.size(); ++j) {
            const double dx = x[3 * j] - x[3 * i], dz = x[3 * j + 2] - x[3 * i + 2];
            if (std::abs(std::hypot(dx, dz) - spacing) > 1e-6 * spacing) continue;
            m.links.emplace_back(i, j);
            // A link along the edge carries half a strip.
            m.widths.push_back(std::max(areas[i], areas[j]) / (spacing * spacing) >= 0.9 ? 1.0 : 0.5);
        }
    }
    return m;
}

// The pressure from above: a bump that moves along the diagonal and is gone after 2 ms.
Values pressure(const Values& x, double t) {
    Values p(x.size() / 3, 0.0);
    if (t >= 2e-3) return p;
    const double pi = std::acos(-1.0), centre = 0.05 + 0.1 * t / 2e-3;
    for (std::size_t i = 0; i < p.size(); ++i) {
        const double r = std::hypot(x[3 * i] - centre, x[3 * i + 2] - centre) / 0.06;
        p[i] = -2e5 * std::pow(std::sin(pi * t / 2e-3), 2) * std::exp(-r * r);
    }
    return p;
}

struct Outcome {
    bool completed = false;
    double broke_at = 0.0;      // time of a breakdown [s]
    double deflection = 0.0;    // largest of a node, at any time [m]
    double work_gap = 0.0;      // |work by the body's ledger - by the membrane's books| over the work
    double reduction = 0.0;     // slowest reduction of the residual per iteration, by a step's mean
    int iterations = 0;         // of all steps
    int most = 0;               // of one step
    int steps = 0;
    Values middle;              // deflection of the middle node by step
};

// Couples to the end; `implicit` with iterations, otherwise one pass per step with the tractions of
// the step before. Residuals go to `log`, if there is one.
Outcome couple(double mass, double h, bool implicit, std::FILE* log, const char* name) {
    Pad pad;
    Membrane membrane = membrane_on(pad, mass);
    const Values x = pad.nodes(), areas = pad.areas();
    const double end = pad.body().end_time();
    const std::size_t middle = areas.size() / 2;
    Values q(areas.size(), 0.0);
    double largest = 1.0, work = 0.0, relaxation = 0.1;
    Outcome o;
    for (int n = 1; n <= std::lround(end / h); ++n) {
        const double time = n * h;
        const Values p = pressure(x, time), before = pad.deflections();
        try {
            if (!implicit) {
                pad.push(q);
                pad.body().advance_to(time);
                const Values w = pad.deflections();
                for (std::size_t i = 0; i < q.size(); ++i) work += areas[i] * q[i] * (w[i] - before[i]);
                q = membrane.traction(w, h, p);
                membrane.accept(w, h);
            } else {
                const std::vector<std::uint8_t> start = pad.body().snapshot();
                Values last_residual, w;
                double first = 0.0;
                for (int k = 1;; ++k) {
                    if (k > 1) pad.body().restore(start);
                    pad.push(q);
                    pad.body().advance_to(time);
                    w = pad.deflections();
                    Values residual = membrane.traction(w, h, p);
                    for (std::size_t i = 0; i < q.size(); ++i) residual[i] -= q[i];
                    largest = std::max(largest, norm(q));
                    const double size = norm(residual) / largest;
                    if (k == 1) first = size;
                    if (log) std::fprintf(log, "%s,%d,%d,%.6e\n", name, n, k, size);
                    ++o.iterations;
                    o.most = std::max(o.most, k);
                    if (size < tolerance) {
                        if (k > 1) o.reduction = std::max(o.reduction, std::pow(size / first, 1.0 / (k - 1)));
                        break;
                    }
                    if (k == most_iterations) return o;
                    if (!last_residual.empty()) {
                        // Aitken: -omega r_k . (r_k+1 - r_k)/|r_k+1 - r_k|^2.
                        double product = 0.0, square = 0.0;
                        for (std::size_t i = 0; i < q.size(); ++i) {
                            const double change = residual[i] - last_residual[i];
                            product += last_residual[i] * change;
                            square += change * change;
                        }
                        relaxation *= -product / square;
                    }
                    for (std::size_t i = 0; i < q.size(); ++i) q[i] += relaxation * residual[i];
                    last_residual = std::move(residual);
                }
                for (std::size_t i = 0; i < q.size(); ++i) work += areas[i] * q[i] * (w[i] - before[i]);
                membrane.accept(w, h);
            }
        } catch (const urlsph::Error& error) {
            if (error.code() != URLSPH_DIVERGED) throw;
            o.broke_at = error.time().value_or(time);
            return o;
        }
        for (double w : membrane.deflection) o.deflection = std::max(o.deflection, std::abs(w));
        o.middle.push_back(membrane.deflection[middle]);
        // Half the pad's thickness: not a deflection any more.
        if (o.deflection > 0.05) {
            o.broke_at = time;
            return o;
        }
        o.steps = n;
    }
    o.completed = true;
    const double ledger = pad.body().energies().external_work;
    o.work_gap = std::abs(work - ledger) / std::abs(ledger);
    return o;
}

int failures = 0;

void check(bool holds, const char* what) {
    if (!holds) {
        std::printf("NOT AS IT SHOULD BE: %s\n", what);
        ++failures;
    }
}

}  // namespace

int main(int argc, char** argv) try {
    std::FILE* log = argc > 1 ? std::fopen(argv[1], "w") : nullptr;
    if (argc > 1 && !log) {
        std::perror(argv[1]);
        return 1;
    }
    if (log) std::fprintf(log, "membrane,step,iteration,residual\n");
    constexpr double h = 1e-4;
    struct Case {
        const char* name;
        double mass;
        bool explicit_works;
    };
    // Within h a wave passes 16 kg/m^2 of rubber (density x wave speed x h): what is lighter follows.
    for (const Case& c : {Case{"light", 2.0, true}, Case{"heavy", 80.0, false}}) {
        const Outcome once = couple(c.mass, h, false, nullptr, c.name);
        const Outcome iterated = couple(c.mass, h, true, log, c.name);
        std::printf("%s membrane, %g kg/m^2\n", c.name, c.mass);
        if (once.completed) {
            std::printf("  explicit: largest deflection %.4f mm\n", 1e3 * once.deflection);
        } else {
            std::printf("  explicit: unstable, largest deflection %.1f mm before it ends at %.2f ms\n",
                        1e3 * once.deflection, 1e3 * once.broke_at);
        }
        std::printf("  implicit: largest deflection %.4f mm, %.1f iterations per step, at most %d\n",
                    1e3 * iterated.deflection,
                    static_cast<double>(iterated.iterations) / std::max(iterated.steps, 1), iterated.most);
        std::printf("  residual to %g in every step, per iteration by %.3f or less on average\n",
                    tolerance, iterated.reduction);
        std::printf("  work of the membrane, its own books against the body's ledger: %.1e of it, "
                    "tolerance 1e-9\n", iterated.work_gap);
        check(once.completed == c.explicit_works, "explicit coupling");
        check(iterated.completed, "the iterations converge in every step");
        check(iterated.reduction < 0.8, "the residual falls per iteration");
        check(iterated.work_gap < 1e-9, "the work agrees");
    }
    // The implicit coupling's own error falls with the step.
    const Outcome coarse = couple(20.0, h, true, nullptr, ""), fine = couple(20.0, h / 2, true, nullptr, ""),
                  finest = couple(20.0, h / 4, true, nullptr, "");
    if (!coarse.completed || !fine.completed || !finest.completed) {
        check(false, "the iterations converge with shorter steps");
        return 1;
    }
    double far = 0.0, near = 0.0;
    for (std::size_t i = 0; i < coarse.middle.size(); ++i) {
        far = std::max(far, std::abs(coarse.middle[i] - fine.middle[2 * i + 1]));
        near = std::max(near, std::abs(fine.middle[2 * i + 1] - finest.middle[4 * i + 3]));
    }
    std::printf("steps of %g, %g and %g us: the deflection changes by %.4f, then by %.4f mm; order %.2f, "
                "at least 0.8\n", 1e6 * h, 5e5 * h, 2.5e5 * h, 1e3 * far, 1e3 * near,
                std::log2(far / near));
    check(std::log2(far / near) > 0.8, "order of the implicit coupling");
    if (log) std::fclose(log);
    if (failures == 0) std::printf("the structural coupling holds\n");
    return failures == 0 ? 0 : 1;
} catch (const urlsph::Error& error) {
    std::fprintf(stderr, "error: %s\n", error.what());
    return error.code();
}
