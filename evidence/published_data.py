#!/usr/bin/env python3
"""Converts published data sets to the format of tests and studies.

    python3 evidence/published_data.py CLONES DATA

CLONES holds clones of the publishers' repositories under their own names (9DTact, FOTS, SerialTrack, PR-GLS, shape-from-shading,
Numerical-Shape-From-Shading) at the commits of docs/data.md; DATA gets a folder per set, for TACTILE_DATA. Needs numpy and scipy.
If files of a set are missing, the set is named and left out.
"""
import csv
import pathlib
import shutil
import sys

import numpy as np
from scipy.io import loadmat
from scipy.spatial import cKDTree


def table(path, heading, rows):
    path.parent.mkdir(parents=True, exist_ok=True)
    with open(path, "w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(heading)
        writer.writerows(rows)


def darkening_gel(clone, out):
    """Sensor 1 of 9DTact: rectified frames, and the authors' table."""
    source = clone / "shape_reconstruction/calibration/sensor_1/depth_calibration"
    depths = np.load(source / "Pixel_to_Depth.npy")
    table(out / "grey_to_depth_mm.csv", ["darkness_grey_levels", "depth_mm"], enumerate(depths.tolist()))
    for name in ("rectify_crop_ref.png", "rectify_crop_sample.png"):
        shutil.copy(source / name, out / name)


def gel_in_colours(clone, out):
    """Every second press of FOTS' GelSight, its circle, and the frame without contact."""
    with open(clone / "mlp_calib/csv/annotate.csv") as file:
        circles = [(row["img_names"].rsplit("/", 1)[-1], row["center_x"], row["center_y"], row["radius"]) for row in csv.DictReader(file)]
    frames = {path.name: path for path in clone.glob("mlp_calib/gelsight/*.png")}
    kept = [row for row in circles if row[0] in frames][::2]
    table(out / "circles.csv", ["image", "center_x_px", "center_y_px", "radius_px"], kept)
    (out / "gelsight").mkdir(exist_ok=True)
    for row in kept:
        shutil.copy(frames[row[0]], out / "gelsight" / row[0])
    shutil.copy(clone / "assets/gel/gelsight_bg.png", out / "reference.png")


def particles(clone, out):
    """Frames of a plane that is stretched along x by 5 % of its first length per frame, and the position of each particle of the
    first frame."""
    frames = loadmat(clone / "SerialTrack2D/Example_main_files/data_syn_uniaxial_stretch_parCoord.mat")["parCoord_prev"].ravel()
    first, centre = frames[0][:, :2], 255.92
    for k, frame in enumerate(frames[:3]):
        table(out / f"stretch2d_frame{k:02}.csv", ["x_px", "y_px"], frame[:, :2].tolist())
        if k == 0:
            continue
        moved = first.copy()
        moved[:, 0] = (1 + 0.05 * k) * (first[:, 0] - centre) + centre
        # The localisation error is 0.3 px, and the spacing is 8 px.
        distance, row = cKDTree(frame[:, :2]).query(moved, distance_upper_bound=2.0)
        table(out / f"stretch2d_truth{k:02}.csv", ["row_in_frame_k_of_frame0_particle"], [[r if np.isfinite(d) else -1] for d, r in zip(distance, row)])


def benchmark(clone, out):
    """Samples 1 to 10 of every level of Chui and Rangarajan's sets as case files, targets in another order."""
    for shape in ("fish", "chinese"):
        for kind in ("def", "noise", "outlier", "occlusion", "rot"):
            lines, mixed = [], np.random.default_rng(1)
            for level in range(1, 10):
                for sample in range(1, 11):
                    path = clone / f"data/save_{shape}_{kind}_{level}_{sample}.mat"
                    if not path.exists():
                        continue
                    sets = loadmat(path)
                    model, target = np.asarray(sets["x1"], float), np.asarray(sets["y2a"], float)
                    order = mixed.permutation(len(target))
                    places = np.argsort(order)
                    lines.append(f"case {shape}_{kind}_{level}_{sample} 2 {len(model)} {len(target)}")
                    lines += [f"m {x!r} {y!r}" for x, y in model.tolist()]
                    lines += [f"t {x!r} {y!r}" for x, y in target[order].tolist()]
                    # Row i of the publishers' targets is the partner of row i of the model. Further rows are outliers.
                    lines += [f"p {places[i] if i < len(target) else -1}" for i in range(len(model))]
            if lines:
                out.mkdir(parents=True, exist_ok=True)
                (out / f"{shape}_{kind}.txt").write_text("\n".join(lines) + "\n")


SETS = [("9dtact", "9DTact", darkening_gel), ("gelsight", "FOTS", gel_in_colours), ("serialtrack", "SerialTrack", particles),
        ("chui_rangarajan", "PR-GLS", benchmark)]

if __name__ == "__main__":
    clones, data = map(pathlib.Path, sys.argv[1:3])
    for folder, clone, make in SETS:
        try:
            (data / folder).mkdir(parents=True, exist_ok=True)
            make(clones / clone, data / folder)
            print(f"{folder}: written")
        except (OSError, KeyError) as error:
            print(f"{folder}: left out, {error}")
