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
        &["`pixel_size_m` must be", "twolines"],
    ),
    (
        "reference = \"reference.png\"",
        "",
        &["`reference` is missing"],
    ),
    (
        "reference = \"reference.png\"",
        "reference = 3",
        &["`reference` must be", "found 3"],
    ),
    (
        "reference = \"reference.png\"",
        "reference = \"none.png\"",
        &["`reference`", "none.png", "cannot read"],
    ),
    (
        "reference = \"reference.png\"",
        "reference = \"pairs.csv\"",
        &["`reference`", "pairs.csv", "cannot decode"],
    ),
    (
        "pixel_size_m = [1e-4, 1e-4]",
        "",
        &["`pixel_size_m` is missing"],
    ),
    (
        "pixel_size_m = [1e-4, 1e-4]",
        "pixel_size_m = [1e-4]",
        &["`pixel_size_m` must be two positive numbers"],
    ),
    (
        "pixel_size_m = [1e-4, 1e-4]",
        "pixel_size_m = [1e-4, 0.0]",
        &["`pixel_size_m` must be two positive numbers"],
    ),
    (
        "pixel_size_m = [1e-4, 1e-4]",
        "pixel_size_m = [nan, 1e-4]",
        &["`pixel_size_m` must be two positive numbers"],
    ),
    (
        "pixel_size_m = [1e-4, 1e-4]",
        "pixel_size_m = 1e-4",
        &["`pixel_size_m` must be two positive numbers"],
    ),
    (
        "pairs = \"pairs.csv\"",
        "",
        &["`calibration.pairs` is missing"],
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
        &["`calibration.pairs` must be alone"],
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
    ("image = \"one.png\"", "", &["`frames[1].image` is missing"]),
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
        &["`frames[1].force_N` must be a positive number"],
    ),
    (
        "force_N = 0.8",
        "force = 1.0",
        &["unknown field `frames[1].force`"],
    ),
    ("shape = \"sphere\"", "", &["`object.shape` is missing"]),
    (
        "shape = \"sphere\"",
        "shape = \"cube\"",
        &["`object.shape` must be", "cube"],
    ),
    ("radius_m = 0.02", "", &["`object.radius_m` is missing"]),
    (
        "radius_m = 0.02",
        "radius_m = inf",
        &["`object.radius_m` must be a positive number"],
    ),
    (
        "radius_m = 0.02",
        "radius_m = \"big\"",
        &["`object.radius_m` must be a positive number", "big"],
    ),
    (
        "poisson_ratio = 0.5",
        "poisson_ratio = 0.6",
        &["`object.poisson_ratio` must be"],
    ),
    (
        "[waveguide]",
        "[waveguides]",
        &["unknown field `waveguides`"],
    ),
    (
        "thickness_m = 0.1",
        "thickness_m = 0",
        &["`waveguide.layers[1].thickness_m` must be a positive number"],
    ),
    (
        "thickness_m = 0.1, ",
        "",
        &["`waveguide.layers[1].thickness_m` is missing"],
    ),
    (
        "refractive_index = 1.41",
        "refractive_index = 0.5",
        &["`waveguide.layers[1].refractive_index` must be"],
    ),
    (
        "youngs_modulus_pa = 1e7",
        "youngs_modulus_pa = -1",
        &["`waveguide.layers[1].youngs_modulus_pa` must be"],
    ),
    (
        "layers = [{ refractive_index = 1.41, thickness_m = 0.1, youngs_modulus_pa = 1e7 }]",
        "layers = []",
        &["`waveguide.layers` must be"],
    ),
    (
        "layers = [{ refractive_index = 1.41, thickness_m = 0.1, youngs_modulus_pa = 1e7 }]",
        "",
        &["`waveguide.layers` is missing"],
    ),
    ("shape = \"sphere\"", "shape = sphere", &["line 12"]),
    (
        "[calibration]",
        "flat_field = true\n[calibration]",
        &["`flat_field` must be \"reference\"", "found true"],
    ),
    (
        "[calibration]",
        "flat_field = \"flat.png\"\n[calibration]",
        &["`flat_field` must be", "\"flat.png\""],
    ),
    (
        "[object]",
        "[stages]\nmatcher = \"icp\"\n[object]",
        &[
            "`stages.matcher` must be one of \"annealed-softassign\"",
            "\"icp\"",
        ],
    ),
    (
        "[object]",
        "[stages]\nreconstruction = 3\n[object]",
        &[
            "`stages.reconstruction` must be",
            "\"tsai-shah\"",
            "found 3",
        ],
    ),
    (
        "[object]",
        "[stages]\nestimator = \"hertz\"\n[object]",
        &["`stages.estimator` must be one of \"best\"", "\"hertz\""],
    ),
    (
        "[object]",
        "[stages]\nmatch = \"relaxation\"\n[object]",
        &["unknown field `stages.match`", "`matcher`"],
    ),
    (
        "pairs = \"pairs.csv\"",
        "depth_table = \"depth.csv\"\n[stages]\nreconstruction = \"eikonal\"",
        &["`stages.reconstruction` must be absent"],
    ),
    (
        "[object]",
        "[stages]\nintegrator = \"cosine-poisson\"\n[object]",
        &["`stages.integrator` must be absent", "\"brooks-horn\""],
    ),
    (
        "force_N = 0.8",
        "time_s = -1.0",
        &["`frames[1].time_s` must be zero or a positive number (seconds)"],
    ),
    (
        "force_N = 0.8",
        "time_s = nan",
        &["`frames[1].time_s` must be zero or a positive number (seconds)"],
    ),
    (
        "force_N = 0.8\n[[frames]]",
        "time_s = 2\n[[frames]]\ntime_s = 1.5",
        &["`frames[2].time_s`: 1.5 s is before the frame that it follows (2 s)"],
    ),
];
