//! Fields and options with values that no sensor has: each is refused by its name.

/// A text of the press's scene, what takes its place, and a word of the sentence.
pub(super) const SCENE: &[(&str, &str, &str)] = &[
    ("[4e-05, 4e-05]", "[4e-05, 40]", "pixel_size_m"),
    ("[4e-05, 4e-05]", "[40, 40]", "pixel_size_m"),
    ("[4e-05, 4e-05]", "[40e-3, 40e-3]", "pixel_size_m"),
    ("[4e-05, 4e-05]", "[4e-05, 5e-04]", "another unit"),
    ("[4e-05, 4e-05]", "[4e-12, 4e-12]", "pixel_size_m"),
    ("[4e-05, 4e-05]", "[-4e-05, 4e-05]", "pixel_size_m"),
    ("[4e-05, 4e-05]", "[4e-05]", "pixel_size_m"),
    ("[4e-05, 4e-05]", "[nan, 4e-05]", "pixel_size_m"),
    ("[4e-05, 4e-05]", "\"40 um\"", "pixel_size_m"),
    ("radius_m = 0.003", "radius_m = 3", "3 mm are 3e-3"),
    ("radius_m = 0.003", "radius_m = 1e6", "radius_m"),
    ("radius_m = 0.003", "radius_m = 3e-9", "radius_m"),
    ("radius_m = 0.003", "radius_m = 0", "radius_m"),
    ("radius_m = 0.003", "radius_m = -3e-3", "radius_m"),
    ("radius_m = 0.003", "radius_m = inf", "radius_m"),
    ("radius_m = 0.003", "radius_m = nan", "radius_m"),
    ("radius_m = 0.003", "radius_mm = 3", "radius_mm"),
    ("thickness_m = 10e-3", "thickness_m = 10", "thickness_m"),
    ("thickness_m = 10e-3", "thickness_m = 0", "thickness_m"),
    ("thickness_m = 10e-3", "thickness_m = 1e-12", "thickness_m"),
    (
        "youngs_modulus_pa = 100e3",
        "youngs_modulus_pa = 0.1",
        "60 kPa are 60e3",
    ),
    (
        "youngs_modulus_pa = 100e3",
        "youngs_modulus_pa = 1e15",
        "youngs_modulus_pa",
    ),
    (
        "youngs_modulus_pa = 100e3",
        "youngs_modulus_pa = -1",
        "youngs_modulus_pa",
    ),
    (
        "youngs_modulus_pa = 100e3, poisson_ratio = 0.5",
        "youngs_modulus_pa = 100e3, poisson_ratio = 5",
        "poisson_ratio",
    ),
    (
        "radius_m = 0.003\npoisson_ratio = 0.5",
        "radius_m = 0.003\npoisson_ratio = 50",
        "poisson_ratio",
    ),
    ("shape = \"sphere\"", "shape = \"ball\"", "shape"),
    (
        "image = \"frame_1.png\"",
        "image = \"frame_1.png\"\nforce_N = 1e6",
        "force_N",
    ),
    (
        "image = \"frame_1.png\"",
        "image = \"frame_1.png\"\nforce_N = -1",
        "force_N",
    ),
    (
        "image = \"frame_1.png\"",
        "image = \"frame_1.png\"\nforce_mN = 10",
        "force_mN",
    ),
    (
        "image = \"frame_1.png\"",
        "image = \"frame_1.png\"\ntime_s = -1",
        "time_s",
    ),
    ("calibration.csv", "swapped_pairs.csv", "swapped"),
    ("calibration.csv", "falling_pairs.csv", "falls"),
    ("calibration.csv", "constant_pairs.csv", "all forces are"),
    ("calibration.csv", "depth_table.csv", "depth_table.csv"),
    (
        "pairs = \"calibration.csv\"",
        "depth_table = \"swapped_depths.csv\"",
        "swapped",
    ),
    ("calibration.csv", "pipe", "a pipe"),
    ("reference.png", "above.pgm", "above the 100"),
    ("reference.png", "folder", "a folder"),
    ("reference.png", "bomb.pgm", "bomb.pgm"),
];

/// The same of the scene of a block.
pub(super) const LUMP: &[(&str, &str, &str)] = &[
    ("[3e-4, 3e-4]", "[3e-4, 0.3]", "pixel_size_m"),
    ("[3e-4, 3e-4]", "[300, 300]", "pixel_size_m"),
    ("[3e-4, 3e-4]", "[3e-4, 4e-3]", "another unit"),
    ("height_m = 30e-3", "height_m = 30", "3 mm are 3e-3"),
    ("height_m = 30e-3", "height_m = 1e-12", "height_m"),
    ("height_m = 30e-3", "height_m = nan", "height_m"),
    ("radius_m = 40e-3", "radius_m = 40", "radius_m"),
    ("radius_m = 16e-3", "radius_m = 16", "radius"),
    ("thickness_m = 10e-3", "thickness_m = 10", "thickness_m"),
    (
        "youngs_modulus_pa = 60e3",
        "youngs_modulus_pa = 0.06",
        "youngs_modulus_pa",
    ),
    (
        "youngs_modulus_pa = 60e3",
        "youngs_modulus_pa = 6e20",
        "youngs_modulus_pa",
    ),
    ("approach_m = 1e-3", "approach_m = 1e3", "approach_m"),
    ("approach_m = 1e-3", "approach_m = -1e-3", "approach_m"),
    ("force_N = 0.4", "force_N = 4e5", "force_N"),
    (
        "poisson_ratio = 0.495",
        "poisson_ratio = 49",
        "poisson_ratio",
    ),
    ("interface = \"bonded\"", "interface = \"glued\"", "glued"),
];

/// Calls with `@` for a value, the values, and a word of the sentence.
pub(super) const OPTIONS: &[(&str, &[&str], &str)] = &[
    (
        "force --reference reference.png --pairs calibration.csv --pixel-um @ frame_1.png",
        &[
            "nan", "inf", "-40", "1e9", "1e-9", "40,400.1", "40,0.001", "40,40,40", "x", "40e-6",
        ],
        "pixel-um",
    ),
    (
        "depth --reference dark_reference.pgm --table depth_table.csv --pixel-um @ dark_frame.pgm",
        &["nan", "inf", "1e7", "100,1", "0,100", "1e-4"],
        "pixel-um",
    ),
    (
        "depth --reference dark_reference.pgm --table depth_table.csv --pixel-um 100 \
         dark_frame.pgm --ball-radius-mm @",
        &["0", "nan", "inf", "4e6", "4e-9", "four"],
        "ball-radius-mm",
    ),
    (
        "measure --radius-mm @",
        &["0", "inf", "3e6", "1e-9", "x", "1e300"],
        "radius-mm",
    ),
    (
        "measure --modulus-kpa @",
        &["nan", "inf", "1e-9", "1e300", "x"],
        "modulus-kpa",
    ),
    (
        "measure --forces @",
        &["nan", "inf", "1e6", "0.7,nan", "0.7,,1", "1e-30"],
        "forces",
    ),
    (
        "measure --points @",
        &["0", "7", "5001", "1e9", "nan"],
        "points",
    ),
    (
        "measure --seed @",
        &["-1", "x", "1.5", "99999999999999999999999"],
        "seed",
    ),
    (
        "measure --repeat @",
        &["0", "-1", "1.5", "99999999999"],
        "repeat",
    ),
    ("stream --rate @", &["nan", "inf", "-1", "x"], "rate"),
    ("stream --period @", &["nan", "inf", "0", "x"], "period"),
    ("stream --cycles @", &["0", "1.5", "99999999999"], "cycles"),
    ("stream --force @", &["0", "inf", "1e9", "x"], "force"),
    ("stream --tolerance @", &["0", "nan", "x"], "tolerance"),
    ("stream --allowed-late @", &["nan", "x"], "allowed-late"),
    (
        "inclusion --design --diameter-mm @",
        &["0.01", "1e-9", "0", "nan", "inf", "1e4"],
        "diameter-mm",
    ),
    (
        "inclusion --design --depth-mm @",
        &["0.01", "inf", "1e6"],
        "depth-mm",
    ),
    (
        "inclusion --design --lump-kpa @",
        &["0", "nan", "1e300"],
        "lump-kpa",
    ),
    (
        "inclusion --design --tissue-kpa @",
        &["0", "nan", "1e-30"],
        "tissue-kpa",
    ),
    ("inclusion --seed @", &["-1", "x"], "seed"),
    (
        "table scene.toml --from-kpa @",
        &["0", "nan", "inf", "1e300", "x"],
        "from-kpa",
    ),
    (
        "table scene.toml --to-kpa @",
        &["0", "nan", "inf", "1e-9"],
        "to-kpa",
    ),
    (
        "table scene.toml --moduli @",
        &["0", "1", "101", "x"],
        "moduli",
    ),
    (
        "table scene.toml --largest-ratio @",
        &["0", "nan", "inf"],
        "largest-ratio",
    ),
    (
        "indent curve.csv --shape sphere --radius @",
        &["5", "5e9", "1e-12", "inf", "x"],
        "radius",
    ),
    (
        "indent curve.csv --shape sphere --ball-radius @",
        &["3", "0", "nan", "1e-12"],
        "ball-radius",
    ),
    (
        "indent curve.csv --shape sphere --radius 5e-3 --thickness @",
        &["2", "0", "nan", "1e-12"],
        "thickness",
    ),
    (
        "indent curve.csv --shape sphere --radius 5e-3 --poisson @",
        &["50", "nan", "-1", "x"],
        "poisson",
    ),
    (
        "indent curve.csv --shape cone --half-angle @",
        &["0", "-70", "nan", "180"],
        "angle",
    ),
    (
        "indent there_and_back.csv --shape sphere --radius @",
        &["5e-3"],
        "falls after it",
    ),
    (
        "calibrate @",
        &[
            "swapped_pairs.csv",
            "falling_pairs.csv",
            "constant_pairs.csv",
        ],
        "_pairs.csv",
    ),
    (
        "force --reference reference.png --pairs @ --pixel-um 40 frame_1.png",
        &[
            "swapped_pairs.csv",
            "falling_pairs.csv",
            "constant_pairs.csv",
        ],
        "_pairs.csv",
    ),
    (
        "depth --reference dark_reference.pgm --table @ --pixel-um 100 dark_frame.pgm",
        &["swapped_depths.csv"],
        "swapped",
    ),
    (
        "reconstruct @ --light 0,0,1",
        &["above.pgm"],
        "above the 100",
    ),
    (
        "reconstruct ball.pgm --light @",
        &["nan,0,1", "0,1", "1,2,3,4", ""],
        "light",
    ),
    (
        "reconstruct ball.pgm --light 0,0,1 --intensity @",
        &["nan", "-5", "inf", "x"],
        "intensity",
    ),
    (
        "integrate slope_x.csv slope_y.csv --pixel-size @",
        &["nan", "-1", "inf", "1,0"],
        "pixel-size",
    ),
    (
        "force --reference reference.png --pairs calibration.csv --pixel-um 40 frame_1.png \
         --memory-gb @",
        &["1e-6", "0", "nan", "-1"],
        "memory-gb",
    ),
    (
        "measure scene.toml --memory-gb @",
        &["1e-5", "nan"],
        "memory-gb",
    ),
    ("stream scene.toml --memory-gb @", &["1e-5"], "memory-gb"),
    ("inclusion lump.toml --memory-gb @", &["1e-5"], "memory-gb"),
    (
        "reconstruct ball.pgm --light 0,0,1 --memory-gb @",
        &["1e-6"],
        "memory-gb",
    ),
    (
        "warp before.csv after.csv before.csv --memory-gb @",
        &["1e-9"],
        "memory-gb",
    ),
    (
        "strain before.csv after.csv --memory-gb @",
        &["1e-9"],
        "memory-gb",
    ),
    (
        "indent curve.csv --shape sphere --radius 5e-3 --memory-gb @",
        &["1e-9"],
        "memory-gb",
    ),
    (
        "calibrate calibration.csv --memory-gb @",
        &["1e-9"],
        "memory-gb",
    ),
    (
        "depth --reference dark_reference.pgm --table depth_table.csv --pixel-um 100 \
         dark_frame.pgm --memory-gb @",
        &["1e-6"],
        "memory-gb",
    ),
    (
        "strain before.csv after.csv --out @",
        &["pipes", "links", "links_in"],
        "remove it",
    ),
    (
        "indent curve.csv --shape sphere --radius 5e-3 --out @",
        &["pipes"],
        "remove it",
    ),
    ("light --rays 100 --out @", &["links"], "out of the folder"),
];
