// The external structural model: a stretched membrane with mass, on the nodes of the interface.
//
//     m d2w/dt2 = T (d2w/dx2 + d2w/dz2) + p(x, z, t) - q
//
// w is its deflection along y, m its mass and T its tension per unit area and length, p the pressure
// from above (here along +y), q the traction that it exerts on what is below. The edges are free. It
// is given w at the end of a step and integrates by implicit Euler: v = (w - w_n)/H, a = (v - v_n)/H.

#pragma once

#include <cstddef>
#include <utility>
#include <vector>

struct Membrane {
    double mass;     // m [kg/m^2]
    double tension;  // T [N/m]
    std::vector<double> areas;                               // of the nodes [m^2]
    std::vector<std::pair<std::size_t, std::size_t>> links;  // of neighbouring nodes
    std::vector<double> widths;  // of the links across, over their lengths

    // State at the end of the last step.
    std::vector<double> deflection, velocity;

    // Tractions on what is below while the nodes go to `w` within the time `h`.
    std::vector<double> traction(const std::vector<double>& w, double h,
                                 const std::vector<double>& pressure) const {
        std::vector<double> q(w.size());
        for (std::size_t i = 0; i < w.size(); ++i) {
            const double v = (w[i] - deflection[i]) / h;
            q[i] = pressure[i] - mass * (v - velocity[i]) / h;
        }
        for (std::size_t l = 0; l < links.size(); ++l) {
            const auto [i, j] = links[l];
            const double force = tension * widths[l] * (w[j] - w[i]);
            q[i] += force / areas[i];
            q[j] -= force / areas[j];
        }
        return q;
    }

    // Accepts the step.
    void accept(const std::vector<double>& w, double h) {
        for (std::size_t i = 0; i < w.size(); ++i) velocity[i] = (w[i] - deflection[i]) / h;
        deflection = w;
    }
};
