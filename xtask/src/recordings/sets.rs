//! The sets as data: columns, the split, the figure to compare with. Nothing here reaches the identification but the columns.

/// One recording set.
pub(crate) struct Set {
    /// Its folder.
    pub name: &'static str,
    pub inputs: &'static [&'static str],
    pub output: &'static str,
    /// Files that teach.
    pub estimation: &'static [&'static str],
    /// The part of each that teaches, where the set has no split of its own.
    pub estimation_share: (f64, f64),
    pub validation: &'static [Validation],
    /// Samples that may initialise a free run, left out of the score.
    pub start: usize,
    /// From the column's unit to the table's.
    pub scale: f64,
    pub unit: &'static str,
}

/// What is judged together: one recording, or several of one kind.
pub(crate) struct Validation {
    pub name: &'static str,
    pub files: &'static [&'static str],
    pub share: (f64, f64),
    /// The error to beat, in the table's unit.
    pub target: Option<f64>,
    /// Where `meta.json` quotes a figure (JSON pointer).
    pub published: &'static str,
}

pub(super) const ALL: (f64, f64) = (0.0, 1.0);

const fn of(
    name: &'static str,
    files: &'static [&'static str],
    target: Option<f64>,
    published: &'static str,
) -> Validation {
    Validation { name, files, share: ALL, target, published }
}

/// A recording cut in the middle, for `--halves`.
pub(crate) const HALVES: Set = Set {
    name: "halves",
    inputs: &["u"],
    output: "y",
    estimation: &[],
    estimation_share: (0.0, 0.5),
    validation: &[],
    start: 0,
    scale: 1.0,
    unit: "",
};

/// All sets.
pub(crate) const SETS: &[Set] = &[
    Set {
        name: "silverbox",
        inputs: &["u_V"],
        output: "y_V",
        estimation: &["silverbox_estimation_multisine.csv"],
        estimation_share: ALL,
        validation: &[
            of(
                "multisine",
                &["silverbox_validation_multisine.csv"],
                Some(0.25),
                "/checked_here/with y^2, y^3 terms, RMSE mV/val_multisine_rmse_mV",
            ),
            of(
                "arrow",
                &["silverbox_validation_arrow.csv"],
                Some(0.30),
                "/checked_here/with y^2, y^3 terms, RMSE mV/arrow_full_rmse_mV",
            ),
        ],
        start: 50,
        scale: 1e3,
        unit: "mV",
    },
    Set {
        name: "wiener_hammerstein",
        inputs: &["u_V"],
        output: "y_V",
        estimation: &["wh_estimation.csv"],
        estimation_share: ALL,
        validation: &[of("validation", &["wh_validation.csv"], Some(1.5), "/published/dynoNet")],
        start: 50,
        scale: 1e3,
        unit: "mV",
    },
    Set {
        name: "boucwen_benchmark_simulated",
        inputs: &["u_N"],
        output: "y_mm",
        estimation: &["boucwen_estimation_multisine.csv"],
        estimation_share: ALL,
        validation: &[
            of("multisine", &["boucwen_validation_multisine.csv"], Some(0.03), "/published/dynoNet"),
            of(
                "sine sweep",
                &["boucwen_validation_sinesweep_part1.csv", "boucwen_validation_sinesweep_part2.csv"],
                None,
                "/none",
            ),
        ],
        start: 50,
        scale: 1.0,
        unit: "mm",
    },
    Set {
        name: "mr_damper_utfpr",
        inputs: &["x_mm", "v_mm_s"],
        output: "F_N",
        // The recording at 0 V is another state of the machine, which no input tells; as in the set's own check.
        estimation: &["mr_exp1.csv", "mr_exp5.csv"],
        estimation_share: ALL,
        validation: &[
            of("vali1", &["mr_vali1.csv"], Some(55.0), "/checked_here/with Dahl friction state, rmse N/mr_vali1"),
            of("exp10", &["mr_exp10.csv"], Some(55.0), "/checked_here/with Dahl friction state, rmse N/mr_exp10"),
        ],
        start: 0,
        scale: 1.0,
        unit: "N",
    },
    Set {
        name: "emps",
        inputs: &["force_N"],
        output: "q_meas_m",
        estimation: &["emps_estimation.csv"],
        estimation_share: ALL,
        validation: &[of("pulses", &["emps_validation_pulses.csv"], None, "/published/dynoNet, test fit")],
        start: 20,
        scale: 1e3,
        unit: "mm",
    },
    Set {
        name: "piezo_fine_steering_mirror",
        inputs: &["u1_V", "u2_V", "u3_V"],
        output: "y1_um",
        estimation: &[
            "fsm_300mV_estimation_r0.csv",
            "fsm_300mV_estimation_r1.csv",
            "fsm_300mV_estimation_r2.csv",
            "fsm_100mV_estimation_r0.csv",
        ],
        estimation_share: ALL,
        validation: &[
            of("y1, 300 mV", &["fsm_300mV_validation_r0.csv"], None, "/none"),
            of("y1, 100 mV", &["fsm_100mV_validation_r0.csv"], None, "/none"),
            of(
                "y1, both",
                &["fsm_300mV_validation_r0.csv", "fsm_100mV_validation_r0.csv"],
                None,
                "/published/official test RMSE in micrometre at 100~1200~1300 mV (relative error)/nonlinear LFR on all",
            ),
        ],
        start: 0,
        scale: 1.0,
        unit: "um",
    },
    Set {
        name: "osu_s809_dynamic_stall",
        inputs: &["alpha_deg"],
        output: "CN",
        estimation: &[
            "C5l100_20.csv",
            "C5l100_14.csv",
            "C5l100_08.csv",
            "C5h100_20.csv",
            "C5h100_14.csv",
            "C5h100_08.csv",
            "C10l100_20.csv",
            "C10l100_14.csv",
            "C10l100_08.csv",
            "C10h100_20.csv",
            "C10h100_14.csv",
            "C10h100_08.csv",
        ],
        estimation_share: ALL,
        validation: &[of(
            "medium frequency, Re 1.0e6",
            &["C5m100_20.csv", "C5m100_14.csv", "C5m100_08.csv", "C10m100_20.csv", "C10m100_14.csv", "C10m100_08.csv"],
            None,
            "/checked_here/rmse of CN/validation/lag_model_rmse",
        )],
        start: 0,
        scale: 1.0,
        unit: "",
    },
    Set {
        name: "mr_damper_boucwen_simulated",
        inputs: &["x_cm", "v_cm_s", "E_V"],
        output: "f_N",
        estimation: &["mr_damper_sim.csv"],
        estimation_share: (0.0, 0.5),
        validation: &[Validation {
            name: "second half",
            files: &["mr_damper_sim.csv"],
            share: (0.5, 1.0),
            target: None,
            published: "/none",
        }],
        start: 0,
        scale: 1.0,
        unit: "N",
    },
    Set {
        name: "rocking_wall_ts1",
        inputs: &["x_m"],
        output: "V_N",
        estimation: &["ts1.csv"],
        estimation_share: (0.0, 0.7),
        validation: &[Validation {
            name: "last 30 % (larger drifts)",
            files: &["ts1.csv"],
            share: (0.7, 1.0),
            target: None,
            published: "/none",
        }],
        start: 0,
        scale: 1e-3,
        unit: "kN",
    },
];
