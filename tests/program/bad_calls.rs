//! A table of calls that cannot work: each ends with the right code and one sentence, and leaves everything as it was.
use super::bad_files;
use super::harness::{run, text};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// Good inputs under short names.
fn good_files(folder: &Path) {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/data");
    for entry in fs::read_dir(&data)
        .unwrap()
        .chain(fs::read_dir(data.join("press")).unwrap())
    {
        let path = entry.unwrap().path();
        if path.is_file() {
            fs::copy(&path, folder.join(path.file_name().unwrap())).unwrap();
        }
    }
}

/// The bytes of all regular files of the folder but the huge one.
fn state(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let entries = fs::read_dir(folder).unwrap().map(Result::unwrap);
    entries
        .map(|entry| {
            let regular = entry.file_type().unwrap().is_file();
            let name = entry.file_name().to_string_lossy().into_owned();
            let small = regular && entry.metadata().unwrap().len() < 1 << 24;
            let bytes = if small {
                fs::read(entry.path()).unwrap()
            } else {
                Vec::new()
            };
            (name, bytes)
        })
        .collect()
}

/// A scene of a block under the guide.
fn lump_scene() -> String {
    r#"reference = "reference.png"
pixel_size_m = [3e-4, 3e-4]
frames = [
    { image = "frame_1.png", approach_m = 1e-3, force_N = 0.4 },
    { image = "frame_2.png", approach_m = 2e-3, force_N = 0.8 },
]
[object]
shape = "block"
height_m = 30e-3
radius_m = 40e-3
interface = "bonded"
[waveguide]
radius_m = 16e-3
layers = [{ thickness_m = 10e-3, youngs_modulus_pa = 60e3, poisson_ratio = 0.495 }]
"#
    .to_owned()
}

/// Places where a file stands that must be an image, `@` for the file.
const IMAGES: [&str; 7] = [
    "force --reference @ --pairs calibration.csv --pixel-um 40 frame_1.png",
    "force --reference reference.png --pairs calibration.csv --pixel-um 40 frame_1.png @",
    "reconstruct @ --light 0,0,1",
    "reconstruct ball.pgm --light 0,0,1 --mask @",
    "depth --reference @ --table depth_table.csv --pixel-um 100 dark_frame.pgm",
    "depth --reference dark_reference.pgm --table depth_table.csv --pixel-um 100 dark_frame.pgm @",
    "integrate slope_x.csv slope_y.csv --mask @",
];

/// Places where a file stands that must be a table.
const TABLES: [&str; 10] = [
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
const CALLS: &[(&str, &str)] = &[
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
    ("strain twice.csv twice.csv", "more than once"),
    ("strain named.csv named.csv", "column named `x`"),
    ("reconstruct ball.pgm", "--light"),
    ("reconstruct ball.pgm --light 0,0", "light"),
    ("reconstruct ball.pgm --light 0,0,0", "light"),
    ("reconstruct ball.pgm --light 0,0,-1", "light"),
    ("reconstruct ball.pgm --light a,b,c", "light"),
    ("reconstruct ball.pgm --light 0,0,inf", "light"),
    (
        "reconstruct ball.pgm --light 0,0,1 --method pentland",
        "oblique",
    ),
    (
        "reconstruct ball.pgm --light 1,0,1 --method pentland --rim 0",
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
        "depth --reference dark_reference.pgm --table depth_table.csv --pixel-um 100 dark_frame.pgm --grey green",
        "green",
    ),
    (
        "depth --reference dark_reference.pgm --table three_depths.csv --pixel-um 100 dark_frame.pgm --zero-table",
        "three_depths.csv",
    ),
    (
        "depth --reference dark_reference.pgm --table depth_table.csv --pixel-um 100 dark_frame.pgm --ball --ball-radius-mm 4",
        "--ball",
    ),
    (
        "depth --reference dark_reference.pgm --table depth_table.csv --pixel-um 100 dark_frame.pgm dark_frame.pgm --out results",
        "two inputs",
    ),
    ("measure absent.toml", "absent.toml"),
    ("measure /dev/zero", "a device"),
    ("measure pipe", "a pipe"),
    ("measure folder", "a folder"),
    ("measure huge", "bytes"),
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
    ("measure --radius-mm nan", "radius-mm"),
    ("measure --modulus-kpa 0", "modulus-kpa"),
    ("measure --polymer steel", "steel"),
    (
        "measure --forces 1e300",
        "force_n is 1e300, expected a number in 0 to ",
    ),
    (
        "strain half_units.csv half_units.csv",
        "the column `y` names no unit",
    ),
    (
        "strain units_later.csv units_later.csv",
        "the column `x` names no unit",
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
    ("light --rays 0", "rays"),
    ("light --rays many", "rays"),
];

/// Files that the calls name, beside the good ones.
fn more_files(folder: &Path) {
    let put = |name: &str, text: &str| fs::write(folder.join(name), text).unwrap();
    put("plain.csv", "x,y\n0,0\n1,0\n0,1\n1,1.5\n");
    put("space.csv", "0,0,0\n1,0,0\n0,1,0\n1,1,1\n");
    put("twice.csv", "x,x,y\n0,0,0\n1,1,1\n");
    put("named.csv", "a,b\n0,0\n1,1\n");
    put("small.csv", "0,0\n0,0\n");
    put("holes.csv", &("nan,".repeat(31) + "1\n").repeat(24));
    put("gramme.csv", "indentation_mm,force (gf)\n0,0\n1,1\n2,3\n");
    put("three.csv", "0,0,0\n1,1,1\n2,3,4\n");
    put("two_rows.csv", "indentation_m,force_N\n0,0\n1e-4,1e-3\n");
    put(
        "three_depths.csv",
        "darkness,depth_mm\n4,0.1\n20,0.5\n60,2\n",
    );
    put("falling.csv", "darkness,depth_mm\n0,0\n5,1\n3,2\n");
    put(
        "equal.csv",
        "integrated_pixel_value,force_N\n1e5,1\n1e5,1\n1e5,1\n",
    );
    let scene = fs::read_to_string(folder.join("scene.toml")).unwrap();
    put(
        "wrong_size.toml",
        &scene.replace("frame_2.png", "dark_frame.pgm"),
    );
    put(
        "misspelt.toml",
        &scene.replace("reference =", "referense ="),
    );
    put("bits.toml", &format!("bits = 99\n{scene}"));
    let lump = lump_scene();
    put("lump.toml", &lump);
    put("lump_sphere.toml", &lump.replace("\"block\"", "\"sphere\""));
    put(
        "lump_backwards.toml",
        &lump.replace("approach_m = 2e-3", "approach_m = 0.5e-3"),
    );
    put(
        "lump_stiff.toml",
        &lump.replace("youngs_modulus_pa = 60e3", "youngs_modulus_pa = -1"),
    );
    put(
        "lump_narrow.toml",
        &lump.replace("radius_m = 40e-3", "radius_m = 10e-3"),
    );
    put(
        "lump_dark.toml",
        &lump.replace("frame_1.png", "reference.png"),
    );
    let no_frames = scene.split("[[frames]]").next().unwrap();
    put("no_frames.toml", no_frames);
    put(
        "black.pgm",
        &format!("P2\n48 48\n255\n{}", "0 ".repeat(48 * 48)),
    );
    put("half_units.csv", "x_um,y\n1,2\n3,4\n5,6\n");
    put("units_later.csv", "x,y_um\n1,2\n3,4\n5,6\n");
    put("million.csv", &"0.5,0.25\n".repeat(1_000_000));
    let samples = (0..400_u16).map(|k| 10 * k).collect();
    let image = image::ImageBuffer::<image::Luma<u16>, Vec<u16>>::from_raw(20, 20, samples);
    image.unwrap().save(folder.join("unclear.png")).unwrap();
}

/// What is wrong with how a call ended; `None` where all is as it should be.
fn complaint(folder: &Path, call: &str, says: &str) -> Option<String> {
    let arguments: Vec<&str> = call.split_whitespace().collect();
    let output = run(folder, &arguments);
    let (out, errors) = (text(&output.stdout), text(&output.stderr));
    let one_sentence = errors.lines().count() == 1 && errors.starts_with("tactile: ");
    // Names of types and fields are for programmers.
    let debug = ["panicked", "Error", "Some(", " { ", "unwrap", "Mismatch"];
    let wrong = if output.status.code() != Some(2) {
        format!("ended with {}", output.status)
    } else if !one_sentence {
        "does not say what is wrong in one sentence".into()
    } else if let Some(word) = debug.iter().find(|word| errors.contains(**word)) {
        format!("says `{word}`")
    } else if !errors.contains(says) {
        format!("does not say `{says}`")
    } else if !out.is_empty() {
        "prints results".into()
    } else {
        return None;
    };
    Some(format!(
        "tactile {call}\n    {wrong}: {}{}",
        errors.trim_end(),
        out.trim_end()
    ))
}

#[test]
fn every_bad_call_is_refused_in_one_sentence_and_changes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    good_files(folder);
    let (images, tables) = bad_files::write(folder);
    more_files(folder);
    let before = state(folder);
    let mut calls: Vec<(String, String)> = Vec::new();
    for (places, files) in [(&IMAGES[..], &images), (&TABLES[..], &tables)] {
        for place in places {
            for file in files {
                let is_case_file = place.starts_with("match");
                // A matrix has any number of columns, and a point as many as the file has.
                let fits =
                    place.starts_with("integrate") && matches!(*file, "wide.csv" | "infinite.csv");
                if fits && !is_case_file {
                    continue;
                }
                let name = file.trim_start_matches("/dev/").trim_end_matches("_a");
                calls.push((place.replace('@', file), name.to_owned()));
            }
        }
    }
    calls.extend(
        CALLS
            .iter()
            .map(|(call, says)| ((*call).to_owned(), (*says).to_owned())),
    );
    assert!(calls.len() >= 120, "{} calls", calls.len());
    let complaints: Vec<String> = (calls.iter())
        .filter_map(|(call, says)| complaint(folder, call, says))
        .collect();
    assert!(
        complaints.is_empty(),
        "{} of {} calls:\n{}",
        complaints.len(),
        calls.len(),
        complaints.join("\n")
    );
    assert!(
        state(folder) == before,
        "a file was changed, made or removed"
    );
}
