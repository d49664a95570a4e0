//! The files used by the calls.
use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::Command;

/// Valid inputs with short names.
pub(super) fn good_files(folder: &Path) {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/data");
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

/// A scene of a block under the guide.
pub(super) fn lump_scene() -> String {
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

/// Further files used by the calls, in addition to the valid ones.
pub(super) fn more_files(folder: &Path) {
    let put = |name: &str, text: &str| fs::write(folder.join(name), text).unwrap();
    put("plain.csv", "x,y\n0,0\n1,0\n0,1\n1,1.5\n");
    put("space.csv", "0,0,0\n1,0,0\n0,1,0\n1,1,1\n");
    put("twice.csv", "x,x,y\n0,0,0\n1,1,1\n");
    put("named.csv", "a,b\n0,0\n1,1\n");
    put("small.csv", "0,0\n0,0\n");
    put("holes.csv", &("nan,".repeat(31) + "1\n").repeat(24));
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
    let press = |x: &str, approach: &str| {
        let frame = format!("{{ image = \"frame_1.png\", approach_m = {approach}, force_N = 1 }}");
        format!("[[presses]]\nposition_m = [{x}, 0]\nframes = [{frame}]\n")
    };
    let presses = |x, other| press(x, "1e-3") + &press("0.01", other);
    let frames = &lump[lump.find("frames").unwrap()..lump.find("[object]").unwrap()];
    let scan = |presses: String| lump.replace(frames, &presses);
    let both = format!("{frames}{}", presses("0", "1e-3"));
    put("lump_scan_two.toml", &scan(both));
    put("lump_scan_other.toml", &scan(presses("0", "2e-3")));
    put("lump_scan_nowhere.toml", &scan(presses("inf", "1e-3")));
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
    put(
        "swapped_pairs.csv",
        "integrated_pixel_value,force_N\n0,0\n0.5,1e5\n1,2e5\n",
    );
    put(
        "falling_pairs.csv",
        "integrated_pixel_value,force_N\n0,2\n1e5,1\n2e5,0\n",
    );
    put(
        "constant_pairs.csv",
        "integrated_pixel_value,force_N\n0,1\n1e5,1\n2e5,1\n",
    );
    put(
        "swapped_depths.csv",
        "darkness,depth_mm\n0,0\n0.5,20\n1.9,60\n",
    );
    let mut samples = b"P5\n48 48\n100\n".to_vec();
    samples.resize(samples.len() + 48 * 48, 200);
    fs::write(folder.join("above.pgm"), samples).unwrap();
    // Result paths that are pipes, or links that lead out of their folder.
    for name in ["pipes", "links", "links_in"] {
        fs::create_dir(folder.join(name)).unwrap();
    }
    let pipe = folder.join("pipes").join("pairs.csv");
    assert!(Command::new("mkfifo").arg(pipe).status().unwrap().success());
    for name in ["pairs.csv", "light.svg"] {
        symlink("../plain.csv", folder.join("links").join(name)).unwrap();
    }
    symlink("/dev/full", folder.join("links_in/pairs.csv")).unwrap();
    // Input tables with the names of result files.
    put(
        "named.toml",
        &scene.replace("calibration.csv", "stream.csv"),
    );
    let pairs = fs::read(folder.join("calibration.csv")).unwrap();
    fs::write(folder.join("stream.csv"), &pairs).unwrap();
    fs::write(folder.join("profiles.csv"), &pairs).unwrap();
    let named = "[calibration]\npairs = \"profiles.csv\"\n[object]";
    put("lump_named.toml", &lump.replace("[object]", named));
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
