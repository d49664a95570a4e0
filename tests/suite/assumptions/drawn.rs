//! Randomly drawn worlds: every stated value is wrong by a draw from its stated error, and light
//! and camera violate up to three assumptions.
use super::worlds::{Check, Stated, World};
use super::{Outcome, ball};
use rand::{Rng, RngExt, SeedableRng, rngs::ChaCha8Rng, seq::IndexedRandom};
use rand_distr::StandardNormal;
use tactile_imaging::pipeline::Flag;

type Departure = (&'static str, fn(&mut World, f64));

/// Violations of the assumptions about light and camera, as a function of a number from −1 to 1. An
/// object with another reflectance is not among them, because the error of the coupling covers it.
const DEPARTURES: [Departure; 10] = [
    ("lamps since the calibration", |w, x| {
        w.lamps = 1.0 + 0.1 * x
    }),
    ("lamps in the frames", |w, x| w.levels = [1.0 + 0.05 * x; 2]),
    ("lamps between the frames", |w, x| {
        w.levels = [1.0, 1.0 + 0.05 * x]
    }),
    ("light as a power of the pressure", |w, x| {
        w.exponent = 1.0 + 0.1 * x
    }),
    ("hysteresis", |w, x| w.hysteresis = 0.03 * x.abs()),
    ("vignetting", |w, x| w.camera.vignetting = 0.1 * x.abs()),
    ("barrel distortion", |w, x| w.camera.barrel = 0.03 * x),
    ("pixels that are not square", |w, x| {
        w.camera.pixel_size_m[1] *= 1.0 + 0.02 * x
    }),
    ("noise", |w, x| {
        w.camera.full_well_electrons /= 1.0 + 8.0 * x.abs();
        w.camera.read_noise_grey *= 1.0 + 2.0 * x.abs();
    }),
    ("coarse pixels", |w, _| w.camera = w.camera.coarser(2)),
];

/// A world whose inputs have the errors that are assumed by default.
fn honest(rng: &mut impl Rng, check: Option<Check>) -> (World, Stated) {
    let mut normal = || rng.sample::<f64, _>(StandardNormal);
    let mut world = World {
        check,
        gauge: 1.0 + 2e-3 * normal(),
        ..World::default()
    };
    let mut stated = Stated {
        layer_moduli: (0.05 * normal()).exp(),
        pixel_size: 1.0 + 3e-3 * normal(),
        object: ball(0.5 - 0.01 * normal().abs(), 1.0 + 5e-3 * normal()),
        weight: 1.0 + 2e-3 * normal(),
        known_ball: [5e-3, 0.02].map(|error| 1.0 + error * normal()),
        ..Stated::default()
    };
    // A guide under a skin for the press of a known ball, a bare guide otherwise.
    let reflectance = (0.12 * normal()).exp();
    if !matches!(check, Some(Check::KnownBall(_))) {
        world.reflectance = reflectance;
        stated.coupling_error = None;
    }
    world.loads_n = *[[0.1, 0.3], [0.3, 0.7], [0.7, 1.2]].choose(rng).unwrap();
    (world, stated)
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Worlds with this check and this number of violated assumptions.
fn draw(check: Option<Check>, departures: usize, count: u64) -> Vec<Outcome> {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut outcomes = Vec::new();
    for seed in 0..count {
        let (mut world, stated) = honest(&mut rng, check);
        let mut names = Vec::new();
        for (name, change) in DEPARTURES.sample(&mut rng, departures) {
            names.push(name);
            change(&mut world, rng.random_range(-1.0..1.0));
        }
        // A refusal is not a silent error.
        let outcome = Outcome::of(world.measure(&stated, 100 + seed)).ok();
        if let Some(outcome) = outcome.as_ref().filter(|outcome| outcome.is_silent()) {
            let percent = 100.0 * outcome.error;
            println!("silent: {percent:+.1} % at {:?} N {names:?}", world.loads_n);
        }
        outcomes.extend(outcome);
    }
    outcomes
}

/// `WORLDS=300` draws 300 worlds of each kind in several minutes, for `.ci/run studies`.
#[test]
fn drawn_worlds_are_held_or_flagged() {
    let count = test_support::draws("WORLDS", 8);
    let sample = Some(Check::Sample);
    let [gently, firmly] = [0.3, 1.1].map(|force_n| Some(Check::KnownBall(force_n)));
    let kinds = [
        (None, 0),
        (None, 3),
        (sample, 0),
        (sample, 3),
        (gently, 0),
        (gently, 3),
        (firmly, 0),
    ];
    for (check, departures) in kinds {
        let outcomes = draw(check, departures, count);
        let all = outcomes.len() as f64;
        let share = |is: fn(&Outcome) -> bool| {
            outcomes.iter().filter(|outcome| is(outcome)).count() as f64 / all
        };
        let held = share(|outcome| outcome.held);
        let silent = share(Outcome::is_silent);
        println!(
            "| {check:?} | {departures} | {:.1} % | ± {:.1} % | {:.1} % | {:.1} % | {:.1} % |",
            100.0 * median(outcomes.iter().map(|outcome| outcome.error.abs())),
            100.0 * median(outcomes.iter().map(|outcome| outcome.half_width)),
            100.0 * held,
            100.0 * share(|outcome| !outcome.flags.is_empty()),
            100.0 * silent,
        );
        // Three standard deviations for this number of draws.
        let slack = 3.0 * (0.05 * 0.95 / all).sqrt();
        assert!(silent < 0.05 + slack, "{check:?}, {departures}: {silent}");
        assert!(departures > 0 || held > 0.95 - slack, "{check:?}: {held}");
    }
}

/// Lamps or exposure change after the calibration, before or after a new reference. `WORLDS=300`
/// draws 300 sessions.
#[test]
fn forces_under_changed_lamps_are_held_or_flagged() {
    let count = test_support::draws("WORLDS", 14);
    let of_light =
        |flag: &Flag| matches!(flag, Flag::LightChanged { .. } | Flag::LightDrifted { .. });
    let changes = [1.0, 0.9, 0.95, 0.98, 1.02, 1.05, 1.1];
    let (mut silent, mut alarms, mut unchanged) = (0, 0, 0);
    for seed in 0..count {
        let change = changes[seed as usize % changes.len()];
        let mut world = World {
            loads_n: [1.0, 1.2],
            ..World::default()
        };
        match seed as usize / changes.len() % 2 {
            0 => world.lamps = change,
            _ => world.levels = [change; 2],
        }
        let found = world.measure(&Stated::default(), 900 + seed).unwrap();
        let frame = found.frames[0].as_ref().unwrap();
        let force = frame.force_n.clone().unwrap();
        let held = (force.value - 1.0).abs() < 1.96 * force.standard_error;
        let flagged = found.flags.iter().any(of_light);
        silent += u64::from(!held && !flagged);
        if change == 1.0 {
            unchanged += 1;
            alarms += u64::from(flagged);
        }
    }
    println!("{silent} of {count} silent, {alarms} alarms in {unchanged} sessions without change");
    assert!(silent as f64 <= 0.05 * count as f64 + 1.0 && alarms <= 1);
}
