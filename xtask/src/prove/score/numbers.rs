//! Numbers that a diagnosis gives, against the true ones: parameters, and the time of an abrupt change.

use super::row::Row;

/// Error of the time of an abrupt change over the record's length, and overlap of the region stated.
pub(super) fn jump(r: &Row) -> Option<(f64, f64)> {
    let e = r.label.effects.first().filter(|e| e.mechanism == "abrupt_change")?;
    let v = r.verdict()?;
    let s = v.effects.iter().find(|s| s.mechanism == "abrupt_change")?;
    let truth = e.parameters.iter().find(|p| p.0 == "t_0")?.1;
    let found = s.parameters.iter().find(|p| p.0 == "t_0")?.1;
    let length = r.label.samples as f64 * r.label.period;
    let inside: f64 = v.time_s.iter().map(|i| (i[1].min(length) - i[0].max(truth)).max(0.0)).sum();
    let stated: f64 = v.time_s.iter().map(|i| (i[1] - i[0]).max(0.0)).sum();
    let overlap = if stated > 0.0 { inside / (stated + (length - truth) - inside) } else { 0.0 };
    Some(((found - truth).abs() / length, overlap))
}

/// Names of a parameter in the bank and in a diagnosis, where both mean the same number; compared by size, since conventions of sign differ.
const SAME_NUMBER: &[(&str, &str, &str)] = &[
    ("coulomb_friction", "F_c", "F_c"),
    ("load_dependent_friction", "mu", "mu"),
    ("dahl_friction", "F_c", "F_c"),
    ("dahl_friction", "z_s", "z_s"),
    ("elastoplastic_friction", "F_c", "F_c"),
    ("quadratic_damping", "c_2", "c_2"),
    ("displacement_dependent_damping", "c_x", "c_x"),
    ("cubic_stiffness", "k_3", "k_3"),
    ("quintic_stiffness", "k_5", "k_5"),
    ("gap_stop", "k_g", "k_g"),
    ("gap_stop", "g", "g"),
    ("quadratic_stiffness", "k_2", "k_2"),
    ("bilinear_stiffness", "k_d", "k_b"),
    ("spring_clearance", "g", "g"),
    ("bouc_wen", "F_z", "F_h"),
    ("backlash", "r", "r"),
    ("dead_zone", "d", "d_z"),
    ("input_saturation", "limit", "s"),
    ("output_saturation", "limit", "s"),
    ("input_polynomial", "b_2", "b_2"),
    ("input_polynomial", "b_3", "b_3"),
    ("delay", "tau", "tau"),
    ("actuator_lag", "tau", "tau"),
    ("sensor_lag", "tau", "tau"),
    ("parameter_drift", "delta", "epsilon"),
    ("abrupt_change", "delta", "delta"),
    ("unmodelled_mode", "m_a", "m_a"),
    ("unmodelled_mode", "f_a", "f_a"),
    ("input_offset", "u_0", "u_0"),
    ("output_offset", "y_0", "y_0"),
    ("gravity", "mgl", "G"),
    ("cogging", "A", "A"),
    ("cogging", "period", "p_x"),
    ("position_dependent_inertia", "m_1", "m_1"),
    ("viscoelastic", "k_m", "k_m"),
    ("viscoelastic", "tau", "tau_m"),
    ("quantisation", "lsb", "q"),
    ("sensor_drift", "rate", "d_1"),
    ("back_emf", "c_e", "k_e"),
    ("back_emf", "tau_e", "tau_e"),
    ("leakage", "c_l", "c_l"),
    ("overflow", "c_o", "c_o"),
    ("periodic_disturbance", "A", "A"),
    ("periodic_disturbance", "f", "f_d"),
];

/// A number that truth and diagnosis share.
pub struct Shared {
    /// Mechanism and parameter, as the diagnosis names them.
    pub name: String,
    /// Its size in truth.
    pub truth: f64,
    /// As it was told, with the sign that the truth has; the ends of the interval are no numbers where none was given.
    pub told: (f64, f64, f64),
}

impl Shared {
    /// Error over the truth.
    pub fn error(&self) -> f64 {
        (self.told.0 / self.truth - 1.0).abs()
    }

    /// Whether the interval holds the truth.
    pub fn is_covered(&self) -> bool {
        self.told.1 <= self.truth && self.truth <= self.told.2
    }
}

/// Every number that truth and diagnosis share, where the mechanism was right.
pub fn shared(r: &Row) -> Vec<Shared> {
    let mut list = Vec::new();
    for e in &r.label.effects {
        let guess = r.guess();
        let Some(s) = guess.iter().find(|s| s.mechanism == e.mechanism && e.slots.first() == Some(&s.slot)) else {
            continue;
        };
        for (mechanism, ours, theirs) in SAME_NUMBER {
            let truth = e.parameters.iter().find(|p| p.0 == *ours).map(|p| p.1.abs());
            let found = s.parameters.iter().find(|p| p.0 == *theirs);
            if let (true, Some(truth), Some(&(_, value, low, high))) = (*mechanism == e.mechanism, truth, found)
                && truth > 0.0
            {
                let (low, high) = if value < 0.0 { (-high, -low) } else { (low, high) };
                list.push(Shared { name: format!("{mechanism}.{theirs}"), truth, told: (value.abs(), low, high) });
            }
        }
    }
    list
}
