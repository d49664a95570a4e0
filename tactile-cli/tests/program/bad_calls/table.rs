//! The calls that cannot work, and what is said of each.

/// Places where a file stands that must be an image, `@` for the file.
pub(super) const IMAGES: [&str; 7] = [
    "force --reference @ --pairs calibration.csv --pixel-um 40 frame_1.png",
    "force --reference reference.png --pairs calibration.csv --pixel-um 40 frame_1.png @",
    "reconstruct @ --light 0,0,1",
    "reconstruct ball.pgm --light 0,0,1 --mask @",
    "depth --reference @ --table depth_table.csv --pixel-um 100 dark_frame.pgm",
    "depth --reference dark_reference.pgm --table depth_table.csv --pixel-um 100 dark_frame.pgm @",
    "integrate slope_x.csv slope_y.csv --mask @",
];

/// Places where a file stands that must be a table.
pub(super) const TABLES: [&str; 10] = [
    "calibrate @",
    "match @",
    "warp @ after.csv before.csv",
    "warp before.csv @ before.csv",
    "warp before.csv before.csv @",
    "strain @ after.csv",
    "strain before.csv @",
    "indent @ --shape sphere --radius 5e-3",
    "integrate @ slope_y.csv",
    "depth --reference dark_reference.pgm --table @ --pixel-um 100 dark_frame.pgm",
];

/// Calls, and a word of the sentence that says what is wrong.
pub(super) const CALLS: &[(&str, &str)] = &[
    ("frobnicate", "frobnicate"),
    ("match", "CASES"),
    ("match cases.txt --method magic", "magic"),
    ("match cases.txt --repeat 0", "repeat"),
    ("match cases.txt --rotation sideways", "sideways"),
    (
        "match cases.txt --method labelling --rotation any",
        "--rotation",
    ),
    ("match cases.txt --out cases.txt", "not a folder"),
    ("match cases.txt --out .", "would replace the input"),
    ("match cases.txt cases.txt --out results", "two inputs"),
    ("match cases.txt --memory-gb 0", "memory-gb"),
    (
        "match cases.txt --memory-gb 1e-9",
        "allow more with --memory-gb",
    ),
    ("match cases.txt --unknown", "--unknown"),
    ("warp before.csv after.csv", "QUERIES"),
    ("warp before.csv after.csv before.csv", "expected 120 rows"),
    (
        "warp before.csv before.csv before.csv --lambda -1",
        "lambda",
    ),
    (
        "warp before.csv before.csv before.csv --lambda nan",
        "lambda",
    ),
    ("warp before.csv before.csv before.csv --kernel r5", "r5"),
    (
        "warp before.csv before.csv plain.csv",
        "unit of its coordinates",
    ),
    ("warp plain.csv space.csv plain.csv", "coordinates"),
    (
        "warp before.csv before.csv before.csv --out /dev/null",
        "not a folder",
    ),
    ("strain before.csv plain.csv", "unit of its coordinates"),
    ("strain plain.csv space.csv", "coordinates"),
    ("strain before.csv after.csv --measure seth", "seth"),
    ("strain million.csv million.csv", "GB"),
    ("strain twice.csv twice.csv", "found more than one"),
    ("strain named.csv named.csv", "column named `x`"),
    ("reconstruct ball.pgm", "--light"),
    ("reconstruct ball.pgm --light 0,0", "light"),
    ("reconstruct ball.pgm --light 0,0,0", "light"),
    ("reconstruct ball.pgm --light 0,0,-1", "light"),
    ("reconstruct ball.pgm --light a,b,c", "light"),
    ("reconstruct ball.pgm --light 0,0,inf", "light"),
    (
        "reconstruct ball.pgm --light 1,0,1 --method tsai-shah --rim 0",
        "--rim",
    ),
    (
        "reconstruct ball.pgm --light 1,0,1 --branch convex",
        "--branch",
    ),
    (
        "reconstruct ball.pgm --light 0,0,1 --mask reference.png",
        "one size",
    ),
    (
        "reconstruct ball.pgm --light 0,0,1 --heights slope_x.csv",
        "one size",
    ),
    (
        "reconstruct ball.pgm --light 0,0,1 --mask black.pgm",
        "no pixel brighter",
    ),
    (
        "reconstruct ball.pgm --light 0,0,1 --intensity 0",
        "intensity",
    ),
    ("reconstruct ball.pgm --light 0,0,1 --ambient -1", "ambient"),
    ("reconstruct ball.pgm --light 0,0,1 --bits 40", "bits"),
    ("reconstruct unclear.png --light 0,0,1", "bits"),
    ("reconstruct unclear.png --light 0,0,1 --bits 8", "bits"),
    ("integrate slope_x.csv before.csv", "before.csv"),
    ("integrate slope_x.csv small.csv", "one size"),
    (
        "integrate slope_x.csv slope_y.csv --pixel-size 0",
        "pixel-size",
    ),
    (
        "integrate slope_x.csv slope_y.csv --pixel-size 1,2,3",
        "pixel-size",
    ),
    (
        "integrate slope_x.csv slope_y.csv --method poisson --mask ball.pgm",
        "one size",
    ),
    (
        "integrate slope_x.csv slope_y.csv --method poisson --heights slope_x.csv",
        "--heights",
    ),
    (
        "integrate slope_x.csv holes.csv --method poisson",
        "not finite",
    ),
    (
        "integrate slope_x.csv slope_y.csv --memory-gb 1e-6",
        "memory-gb",
    ),
    ("indent curve.csv", "--shape"),
    ("indent curve.csv --shape sphere", "--radius"),
    ("indent curve.csv --shape punch", "--radius"),
    ("indent curve.csv --shape egg", "egg"),
    (
        "indent curve.csv --shape sphere --radius 5e-3 --model cone",
        "--model cone is a law for --shape cone",
    ),
    (
        "indent curve.csv --shape sphere --radius 5e-3 --model layer-series",
        "--thickness",
    ),
    (
        "indent curve.csv --shape sphere --radius 5e-3 --model tatara",
        "--ball-radius alone",
    ),
    (
        "indent curve.csv --shape punch --radius 5e-3 --model hertz",
        "--shape sphere",
    ),
    (
        "indent curve.csv --shape cone --model punch",
        "--shape punch",
    ),
    ("indent curve.csv --shape sphere --radius 0", "radius"),
    ("indent curve.csv --shape sphere --radius nan", "radius"),
    (
        "indent curve.csv --shape sphere --ball-radius 3e-3 --thickness 1e-3",
        "--thickness",
    ),
    (
        "indent curve.csv --shape sphere --radius 3e-3 --sliding",
        "--sliding",
    ),
    (
        "indent curve.csv --shape sphere --radius 3e-3 --half-angle 60",
        "--half-angle",
    ),
    ("indent curve.csv --shape cone --radius 3e-3", "--radius"),
    ("indent curve.csv --shape cone --half-angle 90", "angle"),
    (
        "indent curve.csv --shape punch --radius 3e-3 --thickness 1e-3",
        "--thickness",
    ),
    (
        "indent curve.csv --shape sphere --radius 3e-3 --plates",
        "--plates",
    ),
    (
        "indent curve.csv --shape sphere --radius 5e-3 --thickness 2e-3 --no-slip",
        "--no-slip",
    ),
    (
        "indent curve.csv --shape sphere --ball-radius 5e-3 --no-slip",
        "--no-slip",
    ),
    (
        "indent curve.csv --shape sphere --radius 5e-3 --ball-radius 5e-3 --on-plate --no-slip",
        "--no-slip",
    ),
    (
        "indent curve.csv --shape sphere --radius 5e-3 --no-slip --model hertz",
        "--no-slip",
    ),
    (
        "indent curve.csv --shape sphere --radius 5e-3 --poisson 0.6",
        "poisson",
    ),
    (
        "indent curve.csv --shape sphere --radius 5e-3 --contact nan",
        "contact",
    ),
    (
        "indent curve.csv --shape sphere --radius 5e-3 --force-first",
        "--force-first",
    ),
    ("indent gramme.csv --shape sphere --radius 5e-3", "gf"),
    (
        "indent before.csv --shape sphere --radius 5e-3",
        "column named `indentation`",
    ),
    (
        "indent three.csv --shape sphere --radius 5e-3",
        "expected 2 columns",
    ),
    (
        "indent two_rows.csv --shape sphere --radius 5e-3",
        "two_rows.csv",
    ),
    (
        "depth --reference dark_reference.pgm --table depth_table.csv --pixel-um 100",
        "FRAMES",
    ),
    (
        "depth --reference dark_reference.pgm --table depth_table.csv dark_frame.pgm",
        "--pixel-um",
    ),
    (
        "depth --reference dark_reference.pgm --table depth_table.csv --pixel-um -1 dark_frame.pgm",
        "pixel-um",
    ),
    (
        "depth --reference reference.png --table depth_table.csv --pixel-um 100 dark_frame.pgm",
        "one size",
    ),
    (
        "depth --reference dark_reference.pgm --table falling.csv --pixel-um 100 dark_frame.pgm",
        "falling.csv",
    ),
    (
        "depth --reference dark_reference.pgm --table depth_table.csv --pixel-um 100 \
         dark_frame.pgm --grey green",
        "green",
    ),
    (
        "depth --reference dark_reference.pgm --table three_depths.csv --pixel-um 100 \
         dark_frame.pgm --zero-table",
        "three_depths.csv",
    ),
    (
        "depth --reference dark_reference.pgm --table depth_table.csv --pixel-um 100 \
         dark_frame.pgm --ball --ball-radius-mm 4",
        "--ball",
    ),
    (
        "depth --reference dark_reference.pgm --table depth_table.csv --pixel-um 100 \
         dark_frame.pgm dark_frame.pgm --out results",
        "two inputs",
    ),
    ("measure absent.toml", "absent.toml"),
    ("measure /dev/zero", "a device"),
    ("measure pipe", "a pipe"),
    ("measure folder", "a folder"),
    ("measure huge", "huge"),
    ("measure empty", "missing"),
    ("measure garbage", "garbage"),
    ("measure scene.toml --seed 3", "--seed"),
    ("measure scene.toml --polymer cl2003x", "--polymer"),
    ("measure scene.toml --forces 1", "--forces"),
    ("measure scene.toml --points 3", "points"),
    ("measure scene.toml --repeat 0", "repeat"),
    ("measure scene.toml --memory-gb 1e-5", "memory-gb"),
    ("measure --forces 0.7,-1", "forces"),
    ("measure --forces 0", "forces"),
    ("measure --forces 0.7,1e300 --physics hertz", "1000 N"),
    ("measure --forces 1e-12 --physics hertz", "1000 N"),
    ("measure --radius-mm nan", "radius-mm"),
    ("measure --modulus-kpa 0", "modulus-kpa"),
    ("measure --polymer steel", "steel"),
    ("measure --forces 1e300", "1000 N"),
    (
        "measure --forces 2",
        "the force in N is 2, expected a number in 0 to 1.3,",
    ),
    (
        "strain half_units.csv half_units.csv",
        "a unit of the column `y`",
    ),
    (
        "strain units_later.csv units_later.csv",
        "a unit of the column `x`",
    ),
    ("measure wrong_size.toml", "80 × 64"),
    ("measure no_frames.toml", "frames"),
    ("measure misspelt.toml", "referense"),
    ("measure bits.toml", "bits"),
    ("inclusion absent.toml", "absent.toml"),
    ("inclusion scene.toml", "approach_m"),
    ("inclusion lump_sphere.toml", "object.shape"),
    ("inclusion lump_backwards.toml", "frames[2].approach_m"),
    ("inclusion lump_stiff.toml", "youngs_modulus_pa"),
    ("inclusion lump_narrow.toml", "radius"),
    ("inclusion lump_dark.toml", "nothing presses"),
    ("inclusion lump.toml --design --out results", "--out"),
    ("inclusion lump.toml --diameter-mm 4", "--design"),
    ("inclusion --design --depth-mm nan", "depth-mm"),
    (
        "inclusion --design --diameter-mm 1e-9",
        "from 0.5 to 200 mm",
    ),
    ("inclusion lump.toml --seed 2", "--seed"),
    (
        "force --reference reference.png --pairs calibration.csv --pixel-um 40",
        "FRAMES",
    ),
    (
        "force --reference reference.png --pixel-um 40 frame_1.png",
        "--pairs",
    ),
    (
        "force --pairs calibration.csv --pixel-um 40 frame_1.png",
        "--reference",
    ),
    (
        "force --reference reference.png --pairs calibration.csv frame_1.png",
        "--pixel-um",
    ),
    (
        "force --reference reference.png --pairs calibration.csv --pixel-um 0 frame_1.png",
        "pixel-um",
    ),
    (
        "force --reference reference.png --pairs calibration.csv --pixel-um 40 ball.pgm",
        "one size",
    ),
    (
        "force --reference reference.png --pairs equal.csv --pixel-um 40 frame_1.png",
        "equal.csv",
    ),
    ("calibrate equal.csv", "equal.csv"),
    ("calibrate curve.csv", "integrated_pixel_value"),
    (
        "calibrate calibration.csv --out calibration.csv",
        "not a folder",
    ),
    ("stream --rate 0", "rate"),
    ("stream --force nan", "force"),
    ("stream --period 1e9", "GB"),
    ("stream --cycles 0", "cycles"),
    ("stream named.toml --out .", "would replace the input"),
    (
        "stream named.toml frame_1.png --out .",
        "would replace the input",
    ),
    (
        "inclusion lump_named.toml --out .",
        "would replace the input",
    ),
    (
        "measure scene.toml --out cases.txt/results",
        "cannot be written",
    ),
    (
        "light --rays 100 --out cases.txt/results",
        "cannot be written",
    ),
    ("light --rays 0", "rays"),
    ("light --rays many", "rays"),
];
