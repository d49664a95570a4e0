#!/usr/bin/env python3
"""Files of points, tables and frames as other programs write them, and what the program makes of them.

    python3 -m venv V && V/bin/pip install numpy pandas scipy opencv-python-headless tifffile imageio
    V/bin/python evidence/file_formats.py FOLDER [PROGRAM]

Writes the files to FOLDER. With PROGRAM (`target/release/tactile`) each is read by it: the answer has to be that of the
file's numbers, or a refusal with exit code 2 that holds the words of its remedy.
"""
import itertools, json, pathlib, subprocess, sys
import cv2, imageio.v3 as iio, numpy as np, pandas as pd, scipy.io, tifffile

folder = pathlib.Path(sys.argv[1])
folder.mkdir(parents=True, exist_ok=True)
cases = []  # kind of reading, file, number of rows or frames, or words of the refusal


def case(kind, name, expected, write):
    path = folder / name
    content = write(path)
    if isinstance(content, str):
        content = content.encode()
    if isinstance(content, bytes):
        path.write_bytes(content)
    cases.append((kind, path, expected))


# Points: 12 in the plane, coordinates that no other column has.
points = np.array([[10.5 + 3 * k % 7, 20.25 + k] for k in range(12)])
columns = {"x": points[:, 0], "y": points[:, 1]}
frame = pd.DataFrame(columns)
for sep, name in [(",", "comma"), (";", "semicolon"), ("\t", "tab"), (" ", "blank")]:
    case("points", f"pandas_{name}.csv", 12, lambda p: frame.to_csv(p, sep=sep, index=False))
    case("points", f"pandas_index_{name}.csv", 12, lambda p: frame.to_csv(p, sep=sep if sep != " " else ","))
    case("points", f"numpy_{name}.txt", 12, lambda p: np.savetxt(p, points, delimiter=sep))
    case("points", f"numpy_header_{name}.txt", 12, lambda p: np.savetxt(p, points, delimiter=sep, header=f"x{sep}y"))
    case("points", f"numpy_percent_{name}.txt", 12,
         lambda p: np.savetxt(p, points, delimiter=sep, header=f"x{sep}y", comments="% "))
    if sep != ",":
        case("points", f"decimal_comma_{name}.csv", 12, lambda p: frame.to_csv(p, sep=sep, decimal=",", index=False))
for text, name in [("\r\n", "windows"), ("\n", "unix")]:
    case("points", f"ends_{name}.csv", 12, lambda p: frame.to_csv(p, index=False, lineterminator=text))
case("points", "bom.csv", 12, lambda p: frame.to_csv(p, index=False, encoding="utf-8-sig"))
case("points", "utf16.csv", "UTF-16", lambda p: frame.to_csv(p, index=False, encoding="utf-16"))
case("points", "latin_um.csv", 12,
     lambda p: frame.rename(columns={"x": "x (µm)", "y": "y (µm)"}).to_csv(p, index=False, encoding="latin-1"))
case("points", "fixed_width.txt", 12, lambda p: frame.to_string(index=False))
for dtype in ["f8", "f4", ">f8", "i4", "i2", "u1"]:
    case("points", f"points_{dtype.strip('>')}_{dtype[0] == '>'}.npy", 12,
         lambda p: np.save(p, points.astype(dtype)))
case("points", "fortran.npy", 12, lambda p: np.save(p, np.asfortranarray(points)))
case("points", "transposed.npy", "2 or 3 columns", lambda p: np.save(p, points.T))
case("points", "complex.npy", "one array of numbers", lambda p: np.save(p, points.astype(complex)))
case("points", "cube.npy", "one array of numbers", lambda p: np.save(p, np.zeros((3, 4, 5))))
case("points", "savez.npz", 12, lambda p: np.savez(p, points=points))
case("points", "savez_compressed.npz", 12, lambda p: np.savez_compressed(p, points=points))
case("points", "savez_columns.npz", 12, lambda p: np.savez(p, **columns))
case("points", "savez_two.npz", "keep one", lambda p: np.savez(p, a=points, b=points))
case("points", "scipy.mat", 12, lambda p: scipy.io.savemat(p, {"points": points}))
case("points", "scipy_compressed.mat", 12, lambda p: scipy.io.savemat(p, {"points": points}, do_compression=True))
case("points", "scipy_columns.mat", 12, lambda p: scipy.io.savemat(p, columns))
case("points", "scipy_single.mat", 12, lambda p: scipy.io.savemat(p, {"p": points.astype("f4")}))
case("points", "scipy_text.mat", "one array of numbers", lambda p: scipy.io.savemat(p, {"name": "gel"}))
named = [("dice", ["COORDINATE_X", "COORDINATE_Y"]), ("trackmate", ["POSITION_X", "POSITION_Y"]),
         ("paraview", ["Points:0", "Points:1"]), ("capital", ["X", "Y"]), ("pixels", ["x_px", "y_px"]),
         ("brackets", ["x [px]", "y [px]"]), ("quoted", ['"x"', '"y"']), ("millimetres", ["x (mm)", "y (mm)"])]
for name, (x, y) in named:
    rows = "".join(f"p{k},{a},{b},{k}.5\n" for k, (a, b) in enumerate(points))
    case("points", f"named_{name}.csv", 12, lambda p: f"label,{x},{y},quality\n" + rows)
case("points", "feet.csv", "m or a multiple", lambda p: frame.rename(columns={"x": "x (ft)", "y": "y (ft)"}).to_csv(p, index=False))
case("points", "regionprops.csv", 12, lambda p: pd.DataFrame(
    {"label": range(12), "centroid-0": points[:, 1], "centroid-1": points[:, 0]}).to_csv(p))
case("points", "openpiv.txt", 12, lambda p: np.savetxt(
    p, np.c_[points, points, np.zeros((12, 2))], fmt="%.4f", delimiter="\t", header="x\ty\tu\tv\tflags\tmask"))
case("points", "elastix.pts", 12, lambda p: "point\n12\n" + "".join(f"{a} {b}\n" for a, b in points))
case("points", "slicer.fcsv", 12, lambda p: "# Markups fiducial file version = 4.11\n# columns = id,x,y,z,label,desc\n"
     + "".join(f"{k},{a},{b},0.5,F-{k},\n" for k, (a, b) in enumerate(points)))
case("points", "trackmate_7.csv", 12, lambda p: "LABEL,ID,POSITION_X,POSITION_Y\nLabel,Spot ID,X,Y\nLabel,Spot ID,X,Y\n,,(micron),(micron)\n"
     + "".join(f"ID{k},{k},{a},{b}\n" for k, (a, b) in enumerate(points)))
holes = frame.copy()
holes.loc[4, "x"] = np.nan
for word in ["", "nan", "NaN", "NA", "N/A", "null", "-", "1.#QNAN"]:
    case("points", f"hole_{len(cases)}.csv", 11, lambda p: holes.to_csv(p, index=False, na_rep=word))
tracks = pd.DataFrame({"y": np.r_[points[:, 1], points[:, 1]], "x": np.r_[points[:, 0], points[:, 0]],
                       "mass": 9.0, "frame": np.repeat([0, 1], 12), "particle": np.r_[range(12), range(12)]})
case("points", "trackpy.csv", "several frames", lambda p: tracks.to_csv(p))
case("points", "trackpy_one.csv", 12, lambda p: tracks[:12].to_csv(p))
for lines, sep in itertools.product([2, 11], [",", ";", "\t"]):
    preamble = "".join(f"Setting {k}: gel {k}\n" for k in range(lines))
    case("points", f"preamble_{lines}_{ord(sep)}.txt", f"--skip-lines {lines}",
         lambda p: preamble + frame.to_csv(index=False, sep=sep))
case("points", "words.csv", "line 4, column 1", lambda p: "x,y\n1,2\n2,3\nthree,4\n")
case("points", "ragged.csv", "line 3", lambda p: "x,y\n1,2\n2\n3,4\n")
case("points", "empty.csv", "at least one row", lambda p: b"")
case("points", "comment_misfit.csv", "a heading of 3 columns", lambda p: "# x_mm,y_mm\n" + "1,2,3\n" * 3)
case("points", "instrument.bin", "binary file", lambda p: bytes(range(256)) * 20)
case("points", "image_for_table.png", "a PNG image", lambda p: iio.imwrite(p, np.zeros((8, 8), "u1")))
case("points", "sheet.xlsx", "saved as CSV", lambda p: b"PK\x03\x04" + bytes(60))
case("points", "hdf5.mat", "-v7", lambda p: b"\x89HDF\r\n\x1a\n" + bytes(60))

# Depth tables: 20 rows from 0 to 1.9 mm, in units of their heading.
grey, depth = np.arange(20) * 3.0, np.arange(20) * 0.1
for unit, factor, order in itertools.product(["mm", "um", "m"], [1], [0, 1]):
    scale = {"mm": 1, "um": 1e3, "m": 1e-3}[unit]
    both = [("darkness_grey_levels", grey), (f"depth_{unit}", depth * scale)][:: 1 - 2 * order]
    data, names = np.c_[both[0][1], both[1][1]], [both[0][0], both[1][0]]
    case("depth", f"depth_{unit}_{order}.csv", 20, lambda p: pd.DataFrame(data, columns=names).to_csv(p, index=False))
    case("depth", f"depth_comment_{unit}_{order}.txt", 20,
         lambda p: np.savetxt(p, data, delimiter=",", header=",".join(names)))

# Frames: 12 of 32 × 48 pixels, brighter from one to the next.
frames = [np.full((32, 48), 20 + 10 * k, "u1") + np.arange(48, dtype="u1") // 8 for k in range(12)]
jpegs = [cv2.imencode(".jpg", f, [cv2.IMWRITE_JPEG_QUALITY, 95])[1].tobytes() for f in frames]
pngs = [cv2.imencode(".png", f)[1].tobytes() for f in frames]


def chunk(name, data):
    return name + len(data).to_bytes(4, "little") + data + b"\0" * (len(data) % 2)


def avi(codec, data, bits=24):
    word = lambda *values: b"".join((v & 0xFFFFFFFF).to_bytes(4, "little") for v in values)
    head = chunk(b"avih", word(100000, 0, 0, 16, len(data), 0, 1, 0, 48, 32, 0, 0, 0, 0))
    strh = chunk(b"strh", b"vids" + codec + word(0, 0, 0, 1, 10, 0, len(data), 0, 0, 0, 0, 0))
    strf = chunk(b"strf", word(40, 48, 32, 1 | bits << 16) + codec + word(0, 0, 0, 0, 0))
    strl = chunk(b"LIST", b"strl" + strh + strf)
    movi = chunk(b"LIST", b"movi" + b"".join(chunk(b"00dc", d) for d in data))
    return chunk(b"RIFF", b"AVI " + chunk(b"LIST", b"hdrl" + head + strl) + movi)


def without_tables(jpeg):
    at, kept = 2, jpeg[:2]
    while jpeg[at + 1] != 0xDA:
        end = at + 2 + int.from_bytes(jpeg[at + 2 : at + 4], "big")
        kept += b"" if jpeg[at + 1] == 0xC4 else jpeg[at:end]
        at = end
    return kept + jpeg[at:]


case("frames", "pipe.mjpeg", 12, lambda p: b"".join(jpegs))
case("frames", "pipe_png.bin", 12, lambda p: b"".join(pngs))
case("frames", "no_tables.mjpeg", 12, lambda p: b"".join(map(without_tables, jpegs)))
case("frames", "mjpg.avi", 12, lambda p: avi(b"MJPG", jpegs))
case("frames", "no_tables.avi", 12, lambda p: avi(b"MJPG", list(map(without_tables, jpegs))))
case("frames", "dropped.avi", 9, lambda p: avi(b"MJPG", [b"" if k in (4, 5, 8) else j for k, j in enumerate(jpegs)]))
case("frames", "damaged.avi", 11, lambda p: avi(b"MJPG", [j[: len(j) // 2] if k == 5 else j for k, j in enumerate(jpegs)]))
half = bytes(32 * 48 // 2)
case("frames", "i420.avi", 12, lambda p: avi(b"I420", [f.tobytes() + half for f in frames], 12))
case("frames", "y800.avi", 12, lambda p: avi(b"Y800", [f.tobytes() for f in frames], 8))
case("frames", "yuy2.avi", 12, lambda p: avi(b"YUY2", [np.stack([f, f * 0 + 128], 2).tobytes() for f in frames], 16))
case("frames", "uyvy.avi", 12, lambda p: avi(b"UYVY", [np.stack([f * 0 + 128, f], 2).tobytes() for f in frames], 16))
case("frames", "bgr.avi", 12, lambda p: avi(b"\0\0\0\0", [np.repeat(f[::-1, :, None], 3, 2).tobytes() for f in frames]))
for codec in [b"H264", b"FFV1", b"XVID", b"HFYU"]:
    case("frames", f"{codec.decode()}.avi", "ffmpeg -i", lambda p: avi(codec, jpegs))
for name, magic in [("mp4", bytes(4) + b"ftypisom"), ("mkv", b"\x1a\x45\xdf\xa3"), ("ogv", b"OggS"), ("gif", b"GIF89a"), ("bmp", b"BM" + bytes(9))]:
    case("frames", f"video.{name}", "not read", lambda p: magic + bytes(90))
stack = np.stack(frames)
case("frames", "stack.npy", 12, lambda p: np.save(p, stack))
case("frames", "stack.npz", 12, lambda p: np.savez_compressed(p, stack))
case("frames", "stack.tif", 12, lambda p: tifffile.imwrite(p, stack, photometric="minisblack"))
case("frames", "stack_lzw_free.tif", 12, lambda p: tifffile.imwrite(p, stack, compression="zlib", photometric="minisblack"))
case("frames", "stack.big.tif", "BigTIFF", lambda p: tifffile.imwrite(p, stack, bigtiff=True, photometric="minisblack"))
case("frames", "float.tif", "whole numbers", lambda p: tifffile.imwrite(p, stack.astype("f4"), photometric="minisblack"))
case("frames", "float64.tif", "whole numbers", lambda p: tifffile.imwrite(p, stack.astype("f8"), photometric="minisblack"))
case("frames", "signed.tif", "whole numbers", lambda p: tifffile.imwrite(p, stack.astype("i2"), photometric="minisblack"))
case("frames", "u32.tif", "whole numbers", lambda p: tifffile.imwrite(p, stack.astype("u4"), photometric="minisblack"))
case("frames", "ten_bits.tif", "bits", lambda p: tifffile.imwrite(p, stack.astype("u2") * 4, photometric="minisblack"))
case("frames", "twelve_bits.png", "bits", lambda p: iio.imwrite(p, frames[11].astype("u2") * 16))
case("frames", "table_for_frames.csv", "a text that begins", lambda p: frame.to_csv(p, index=False))
case("frames", "truncated.jpg", "cannot use the image", lambda p: jpegs[0][:300])

(folder / "cases.txt").write_text("".join(f"{kind} {path}\n" for kind, path, _ in cases))
print(len(cases), "files in", folder)


def read(program, kind, path):
    """Exit code, and rows or frames that were read, or the sentence."""
    reference = folder / "reference.png"
    iio.imwrite(reference, frames[0])
    table = folder / "depth_mm_0.csv"
    call = {"points": ["warp", folder / "pandas_comma.csv", folder / "pandas_comma.csv", path],
            "depth": ["depth", "--reference", reference, "--table", path, "--pixel-um", "100", reference],
            "frames": ["depth", "--reference", reference, "--table", table, "--pixel-um", "100", path]}[kind]
    if kind == "points":
        call[1:3] = [path, path]
    done = subprocess.run([program, *map(str, call), "--json"], capture_output=True, text=True)
    if done.returncode == 2 or not done.stdout.strip():
        return done.returncode, done.stderr
    answer = json.loads(done.stdout)
    return done.returncode, answer["points"] if kind == "points" else 20 if kind == "depth" else len(answer["frames"])


if len(sys.argv) > 2:
    wrong = 0
    for kind, path, expected in cases:
        code, found = read(sys.argv[2], kind, path)
        fits = found == expected if isinstance(expected, int) else code == 2 and expected in found
        wrong += not fits
        if not fits:
            print(f"{path.name}: expected {expected}, found {found} (exit code {code})")
    print(len(cases) - wrong, "of", len(cases), "as they should be")
    sys.exit(wrong > 0)
