//! Mistakes in a scene file.

/// Replacement in the valid file, and what the sentence must contain.
pub(super) const MISTAKES: &[(&str, &str, &[&str])] = &[
    // Names and texts of several lines; the sentence has one.
    (
        "[object]",
        "\"two\\nlines\" = 1\n[object]",
        &["unknown field", "twolines`"],
    ),
    (
        "pixel_size_m = [1e-4, 1e-4]",
        "pixel_size_m = \"two\\nlines\"",
        &["`pixel_size_m`", "two\\nlines", "array of length 2"],
    ),
    (
        "reference = \"reference.png\"",
        "",
        &["missing field `reference`"],
    ),
    (
        "reference = \"reference.png\"",
        "reference = 3",
        &["`reference`", "integer `3`"],
    ),
    (
        "reference = \"reference.png\"",
        "reference = \"none.png\"",
        &["`reference`", "none.png", "cannot read"],
    ),
    (
        "reference = \"reference.png\"",
        "reference = \"pairs.csv\"",
        &["`reference`", "pairs.csv", "cannot use the image"],
    ),
    (
        "pixel_size_m = [1e-4, 1e-4]",
        "",
        &["`pixel_size_m`: it is missing"],
    ),
    (
        "pixel_size_m = [1e-4, 1e-4]",
        "pixel_size_m = [1e-4]",
        &["`pixel_size_m`", "array of length 2"],
    ),
    (
        "pixel_size_m = [1e-4, 1e-4]",
        "pixel_size_m = [1e-4, 0.0]",
        &[
            "`pixel_size_m[2]`",
            "expected the side of a pixel in metres",
        ],
    ),
    (
        "pixel_size_m = [1e-4, 1e-4]",
        "pixel_size_m = [nan, 1e-4]",
        &[
            "`pixel_size_m[1]`",
            "expected the side of a pixel in metres",
        ],
    ),
    (
        "pixel_size_m = [1e-4, 1e-4]",
        "pixel_size_m = 1e-4",
        &["`pixel_size_m`", "array of length 2"],
    ),
    (
        "pairs = \"pairs.csv\"",
        "",
        &["`calibration`: expected `pairs` or `depth_table`"],
    ),
    (
        "pairs = \"pairs.csv\"",
        "pairs = \"none.csv\"",
        &["`calibration.pairs`", "none.csv"],
    ),
    (
        "pairs = \"pairs.csv\"",
        "pairs = \"depth.csv\"",
        &["`calibration.pairs`", "integrated_pixel_value"],
    ),
    (
        "pairs = \"pairs.csv\"",
        "pairs = \"short.csv\"",
        &["`calibration.pairs`", "cannot be fitted"],
    ),
    (
        "pairs = \"pairs.csv\"",
        "pairs = \"bad.csv\"",
        &[
            "`calibration.pairs`",
            "bad.csv, line 3, column 2",
            "found `x`",
        ],
    ),
    (
        "pairs = \"pairs.csv\"",
        "pairs = \"pairs.csv\"\ndepth_table = \"depth.csv\"",
        &["`calibration`: expected `pairs` or `depth_table`, found both"],
    ),
    (
        "pairs = \"pairs.csv\"",
        "depth_table = \"pairs.csv\"",
        &["`calibration.depth_table`", "`darkness`"],
    ),
    (
        "[calibration]",
        "[calibrations]",
        &["unknown field `calibrations`"],
    ),
    (
        "image = \"one.png\"",
        "",
        &["`frames[1]`: missing field `image`"],
    ),
    (
        "image = \"two.pgm\"",
        "image = \"three.pgm\"",
        &["`frames[2].image`", "three.pgm"],
    ),
    (
        "image = \"two.pgm\"",
        "image = \"small.png\"",
        &["`frames[2].image`", "small.png is 7 × 5", "80 × 60"],
    ),
    (
        "image = \"two.pgm\"",
        "image = \"reference.png\"",
        &["frames[2].image", "reference.png", "no contact"],
    ),
    (
        "image = \"two.pgm\"",
        "image = \"white.png\"",
        &["frames[2].image", "white.png", "saturated"],
    ),
    (
        "force_N = 0.8",
        "force_N = -1.0",
        &["`frames[1].force_N`", "expected a force in newtons"],
    ),
    (
        "force_N = 0.8",
        "force = 1.0",
        &["`frames[1]", "unknown field `force`"],
    ),
    (
        "shape = \"sphere\"",
        "",
        &["`object`: missing field `shape`"],
    ),
    (
        "shape = \"sphere\"",
        "shape = \"cube\"",
        &["`object.shape", "cube", "`sphere`"],
    ),
    ("radius_m = 0.02", "", &["`object.radius_m`: it is missing"]),
    (
        "radius_m = 0.02",
        "radius_m = inf",
        &["`object.radius_m`", "expected a length in metres"],
    ),
    (
        "radius_m = 0.02",
        "radius_m = \"big\"",
        &["`object.radius_m`", "big", "expected a length in metres"],
    ),
    (
        "poisson_ratio = 0.5",
        "poisson_ratio = 0.6",
        &["`object.poisson_ratio`", "at most 0.5"],
    ),
    (
        "[waveguide]",
        "[waveguides]",
        &["unknown field `waveguides`"],
    ),
    (
        "thickness_m = 0.1",
        "thickness_m = 0",
        &[
            "`waveguide.layers[1].thickness_m`",
            "expected a length in metres",
        ],
    ),
    (
        "thickness_m = 0.1, ",
        "",
        &["`waveguide.layers[1]`: missing field `thickness_m`"],
    ),
    (
        "refractive_index = 1.41",
        "refractive_index = 0.5",
        &["`waveguide.layers[1].refractive_index`", "at least 1"],
    ),
    (
        "youngs_modulus_pa = 1e7",
        "youngs_modulus_pa = -1",
        &[
            "`waveguide.layers[1].youngs_modulus_pa`",
            "expected a modulus in pascals",
        ],
    ),
    (
        "layers = [{ refractive_index = 1.41, thickness_m = 0.1, youngs_modulus_pa = 1e7 }]",
        "layers = []",
        &["`waveguide.layers`", "one or more"],
    ),
    (
        "layers = [{ refractive_index = 1.41, thickness_m = 0.1, youngs_modulus_pa = 1e7 }]",
        "",
        &["`waveguide`: missing field `layers`"],
    ),
    ("shape = \"sphere\"", "shape = sphere", &["line 12"]),
    (
        "[calibration]",
        "flat_field = true\n[calibration]",
        &["`flat_field`", "expected a string"],
    ),
    (
        "[calibration]",
        "flat_field = \"flat.png\"\n[calibration]",
        &["`flat_field", "flat.png", "expected `reference`"],
    ),
    (
        "[object]",
        "[stages]\nmatcher = \"icp\"\n[object]",
        &[
            "`stages.matcher",
            "expected one of `annealed-softassign`",
            "`icp`",
        ],
    ),
    (
        "[object]",
        "[stages]\nreconstruction = 3\n[object]",
        &["`stages.reconstruction`", "expected a string"],
    ),
    (
        "[object]",
        "[stages]\nestimator = \"hertz\"\n[object]",
        &["`stages.estimator", "expected one of `best`", "`hertz`"],
    ),
    (
        "[object]",
        "[stages]\nmatch = \"relaxation\"\n[object]",
        &["`stages", "unknown field `match`", "`matcher`"],
    ),
    (
        "pairs = \"pairs.csv\"",
        "depth_table = \"depth.csv\"\n[stages]\nreconstruction = \"eikonal\"",
        &["`stages.reconstruction`: expected none"],
    ),
    (
        "[object]",
        "[stages]\nintegrator = \"cosine-poisson\"\n[object]",
        &["`stages.integrator`: expected none", "\"brooks-horn\""],
    ),
    (
        "force_N = 0.8",
        "time_s = -1.0",
        &["`frames[1].time_s`", "expected zero or a positive number"],
    ),
    (
        "force_N = 0.8",
        "time_s = nan",
        &["`frames[1].time_s`", "expected zero or a positive number"],
    ),
    (
        "force_N = 0.8\n[[frames]]",
        "time_s = 2\n[[frames]]\ntime_s = 1.5",
        &["`frames[2].time_s`: 1.5 s is before the frame that it follows (2 s)"],
    ),
];
