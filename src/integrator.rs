//! Runge-Kutta over fields; no physics.

/// One stage: y = keep y^n + take (y + dt dy/dt).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stage {
    /// Share of the state at the step's start.
    pub keep: f64,
    /// Share of the advanced state.
    pub take: f64,
    /// Time of the state whose rates the stage uses, in steps after the start.
    pub time: f64,
    /// Weight of these rates in the whole step: y^{n+1} = y^n + dt sum weight k.
    pub weight: f64,
    /// Share of a change made to the state after this stage that reaches the step's end.
    pub carry: f64,
}

/// Three-stage strong-stability-preserving Runge-Kutta ([URL22] 61).
pub const SSP_RK3: [Stage; 3] = [
    Stage {
        keep: 0.0,
        take: 1.0,
        time: 0.0,
        weight: 1.0 / 6.0,
        carry: 1.0 / 6.0,
    },
    Stage {
        keep: 0.75,
        take: 0.25,
        time: 1.0,
        weight: 1.0 / 6.0,
        carry: 2.0 / 3.0,
    },
    Stage {
        keep: 1.0 / 3.0,
        take: 2.0 / 3.0,
        time: 0.5,
        weight: 2.0 / 3.0,
        carry: 1.0,
    },
];

/// Factors of v^n, of the velocity of the stage before, and of the present velocity, in steps, that
/// with x^n make the arm of a stage for which the step conserves angular momentum. [URL22] 64 with
/// its misprint mended: sum x^{n+1} x p^{n+1} worked out for the three stages gives x^n - dt v^n,
/// x^n + dt/6 (v^* - v^n), x^n + dt/6 (v^n + v^* + 4 v^**).
pub const ANGULAR_ARMS: [[f64; 3]; 3] = [
    [-1.0, 0.0, 0.0],
    [-1.0 / 6.0, 0.0, 1.0 / 6.0],
    [1.0 / 6.0, 1.0 / 6.0, 4.0 / 6.0],
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn third_order_with_consistent_weights() {
        let error = |n: usize| {
            let dt = 1.0 / n as f64;
            let (mut y, mut integral) = (1.0f64, 0.0);
            for _ in 0..n {
                let start = y;
                for s in SSP_RK3 {
                    integral += dt * s.weight * -y;
                    y = s.keep * start + s.take * (y - dt * y);
                }
            }
            assert!((1.0 + integral - y).abs() < 1e-14);
            (y - (-1.0f64).exp()).abs()
        };
        let order = (error(20) / error(40)).log2();
        println!("observed order {order:.3} (3 +- 0.05)");
        assert!((order - 3.0).abs() < 0.05);
    }
}
