//! Tables and figures from summaries made by hand.

use super::*;
use crate::image::Picture;
use crate::image::metrics::Reference;
use crate::integrators::Counts;
use crate::math::Rgb;
use crate::report::comparison::{Comparison, Configuration, Run};
use crate::report::curve::Point;

/// An outcome whose configurations have these errors c / time, over 1 to 32 passes of these seconds each.
fn outcome(name: &'static str, configs: &[(&str, f64, f64)]) -> super::super::Outcome {
    let truth = Picture::new(16, 16, vec![Rgb::splat(0.5); 256]);
    let reference = Reference::new(&truth, None).unwrap();
    let configuration = |&(name, c, seconds): &(&str, f64, f64)| {
        let points: Vec<Point> = (0..6)
            .map(|i| (1u64 << i, seconds * f64::from(1 << i)))
            .map(|(passes, t)| Point { passes, cpu_seconds: t, wall_seconds: t, photons: 0, relmse: c / t })
            .collect();
        // A picture with the error of the last point.
        let off = (points[5].relmse * 0.26).sqrt() as f32;
        let picture = Picture::new(16, 16, vec![Rgb::splat(0.5 + off); 256]);
        let run = Run {
            seed: 0,
            points,
            counts: Counts { samples: 256, photons: 10, ..Counts::default() },
            favoured_pixels: 0.03,
            picture: picture.pixels.clone(),
            errors: reference.errors(&picture, 0.1).unwrap(),
        };
        Configuration {
            name: name.to_string(),
            flags: String::new(),
            integrator: "photon".into(),
            runs: vec![run],
            maps: Vec::new(),
            remarks: Vec::new(),
        }
    };
    let comparison = Comparison {
        scene: "scene".into(),
        equal: String::new(),
        reference_text: String::new(),
        configurations: configs.iter().map(configuration).collect(),
        reference: reference.clone(),
        exposure: 0.0,
        notes: Vec::new(),
    };
    let summaries = comparison.summaries();
    super::super::Outcome { name, comparison, summaries }
}

#[test]
fn figures_follow_from_known_outcomes() {
    let outcomes = Outcomes(vec![
        outcome(
            "ablation",
            &[
                (UNIFORM, 50.0, 1.0),
                (PHOTONS, 40.0, 1.0),
                (LIGHT, 8.0, 1.0),
                (BOTH, 5.0, 1.0),
                (ALL, 1.0, 1.0),
                (SOBOL[0], 2.0, 1.0),
            ],
        ),
        outcome("shares", &[("light", 1.0, 1.0), ("antialiasing", 1.0, 1.0)]),
        outcome(
            "photons",
            &[
                ("uniform, k nearest", 3.0, 1.0),
                ("uniform, fixed", 2.0, 1.0),
                (FIFTH[0].0, 1.2, 1.0),
                (FIFTH[1].0, 1.0, 1.0),
            ],
        ),
    ]);
    let found = findings(&outcomes);
    let figure = |name: &str| found.figures.iter().find(|f| f.0 == name).unwrap().1;
    let near = |name: &str, expected: f64| {
        let v = figure(name).unwrap();
        assert!((v / expected - 1.0).abs() < 1e-4, "{name}: {v}, not {expected}");
    };
    // Curves overlap: uniform ends at 50 / 32, where the adaptive one is after 0.64 s, before its first point.
    near("speedup_all", 32.0);
    near("aa_share", 0.03);
    near("photon_error_ratio_at_one_fifth", 0.5);
    near("photon_error_ratio_at_one_fifth_with_usual_kernels", 0.6);
    assert!(figure("caustic_relmse_gain_equal_time").is_none(), "what was not run has no figure");

    let (title, table) = &found.tables[0];
    assert!(title.contains("1.56e0"), "{title}");
    let row = |name: &str| table.rows.iter().find(|r| r[0] == name).unwrap();
    assert_eq!(&row(UNIFORM)[1..3], ["15538 (?)", NOTHING], "no ratio is made of the doubtful figure");
    assert_eq!(&row(ALL)[1..3], ["121", "0.011"]);
    // 8 / 40 of the time for light alone; the paper: 0.195.
    assert_eq!((&row(LIGHT)[2], &row(LIGHT)[4]), (&"0.195".to_string(), &"0.200".to_string()));
    assert_eq!(row(SOBOL[0])[1], NOTHING);
    near("speedup_over_owen_sobol", 2.0);
    assert!(found.doubts[0].contains("15,538"));
}

#[test]
fn the_best_uniform_kernel_is_the_baseline() {
    let outcome =
        outcome("caustic", &[("uniform, k nearest", 3.0, 1.0), ("uniform, fixed", 2.0, 1.0), ("adaptive", 0.5, 1.0)]);
    assert_eq!(best_uniform(&outcome.summaries).unwrap().name, "uniform, fixed");
    let found = findings(&Outcomes(vec![outcome]));
    let gain = found.figures.iter().find(|f| f.0 == "caustic_relmse_gain_equal_time").unwrap().1.unwrap();
    assert!((gain - 4.0).abs() < 1e-3, "{gain}");
}
