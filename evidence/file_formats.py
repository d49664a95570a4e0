#!/usr/bin/env python3
"""Files of points, tables and frames as other programs write them, and what the program makes of them.

    python3 -m venv V && V/bin/pip install numpy pandas scipy opencv-python-headless tifffile imageio
    V/bin/python evidence/file_formats.py FOLDER [PROGRAM]

Writes the files to FOLDER. With PROGRAM (`target/release/tactile`) each is read by it: the answer has to be that of the
file's numbers, or a refusal with exit code 2 in one sentence that holds the words of its remedy and none of a library.
"""
import itertools, json, pathlib, re, subprocess, sys, zipfile
import cv2, imageio.v3 as iio, numpy as np, pandas as pd, scipy.io, tifffile

folder = pathlib.Path(sys.argv[1])
folder.mkdir(parents=True, exist_ok=True)
cases = []  # kind of reading, file, numbers that are read, or words of the refusal

# What readers and decoders say in their own words.
FOREIGN = re.compile(r"Unknown\(|Some\(|None|Err\(|panicked|component Y|ColorType|Format error|invalid digit|decoding|os error 22|TiffError")


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
holed = np.delete(points, 4, 0)
columns = {"x": points[:, 0], "y": points[:, 1]}
frame = pd.DataFrame(columns)
for sep, name in [(",", "comma"), (";", "semicolon"), ("\t", "tab"), (" ", "blank")]:
    case("points", f"pandas_{name}.csv", points, lambda p: frame.to_csv(p, sep=sep, index=False))
    case("points", f"pandas_index_{name}.csv", points, lambda p: frame.to_csv(p, sep=sep if sep != " " else ","))
    case("points", f"numpy_{name}.txt", points, lambda p: np.savetxt(p, points, delimiter=sep))
    case("points", f"numpy_header_{name}.txt", points, lambda p: np.savetxt(p, points, delimiter=sep, header=f"x{sep}y"))
    case("points", f"numpy_percent_{name}.txt", points,
         lambda p: np.savetxt(p, points, delimiter=sep, header=f"x{sep}y", comments="% "))
    if sep != ",":
        case("points", f"decimal_comma_{name}.csv", points, lambda p: frame.to_csv(p, sep=sep, decimal=",", index=False))
for text, name in [("\r\n", "windows"), ("\n", "unix")]:
    case("points", f"ends_{name}.csv", points, lambda p: frame.to_csv(p, index=False, lineterminator=text))
case("points", "bom.csv", points, lambda p: frame.to_csv(p, index=False, encoding="utf-8-sig"))
case("points", "utf16.csv", "UTF-16", lambda p: frame.to_csv(p, index=False, encoding="utf-16"))
case("points", "latin_um.csv", points * 1e-6,
     lambda p: frame.rename(columns={"x": "x (µm)", "y": "y (µm)"}).to_csv(p, index=False, encoding="latin-1"))
case("points", "fixed_width.txt", points, lambda p: frame.to_string(index=False))
for dtype in ["f8", "f4", ">f8", "i4", "i2", "u1"]:
    case("points", f"points_{dtype.strip('>')}_{dtype[0] == '>'}.npy", points.astype(dtype).astype(float),
         lambda p: np.save(p, points.astype(dtype)))
case("points", "fortran.npy", points, lambda p: np.save(p, np.asfortranarray(points)))
case("points", "transposed.npy", "2 or 3 columns", lambda p: np.save(p, points.T))
case("points", "complex.npy", "one array of numbers", lambda p: np.save(p, points.astype(complex)))
case("points", "cube.npy", "one array of numbers", lambda p: np.save(p, np.zeros((3, 4, 5))))
case("points", "savez.npz", points, lambda p: np.savez(p, points=points))
case("points", "savez_compressed.npz", points, lambda p: np.savez_compressed(p, points=points))
case("points", "savez_columns.npz", points, lambda p: np.savez(p, **columns))
case("points", "savez_two.npz", "keep one", lambda p: np.savez(p, a=points, b=points))
case("points", "scipy.mat", points, lambda p: scipy.io.savemat(p, {"points": points}))
case("points", "scipy_compressed.mat", points, lambda p: scipy.io.savemat(p, {"points": points}, do_compression=True))
case("points", "scipy_columns.mat", points, lambda p: scipy.io.savemat(p, columns))
case("points", "scipy_single.mat", points, lambda p: scipy.io.savemat(p, {"p": points.astype("f4")}))
case("points", "scipy_text.mat", "one array of numbers", lambda p: scipy.io.savemat(p, {"name": "gel"}))
named = [("dice", ["COORDINATE_X", "COORDINATE_Y"]), ("trackmate", ["POSITION_X", "POSITION_Y"]),
         ("paraview", ["Points:0", "Points:1"]), ("capital", ["X", "Y"]), ("pixels", ["x_px", "y_px"]),
         ("brackets", ["x [px]", "y [px]"]), ("quoted", ['"x"', '"y"']), ("millimetres", ["x (mm)", "y (mm)"])]
for name, (x, y) in named:
    rows = "".join(f"p{k},{a},{b},{k}.5\n" for k, (a, b) in enumerate(points))
    case("points", f"named_{name}.csv", points * (1e-3 if "mm" in x else 1), lambda p: f"label,{x},{y},quality\n" + rows)
case("points", "feet.csv", "m or a multiple", lambda p: frame.rename(columns={"x": "x (ft)", "y": "y (ft)"}).to_csv(p, index=False))
case("points", "regionprops.csv", points, lambda p: pd.DataFrame(
    {"label": range(12), "centroid-0": points[:, 1], "centroid-1": points[:, 0]}).to_csv(p))
case("points", "openpiv.txt", points, lambda p: np.savetxt(
    p, np.c_[points, points, np.zeros((12, 2))], fmt="%.4f", delimiter="\t", header="x\ty\tu\tv\tflags\tmask"))
case("points", "elastix.pts", points, lambda p: "point\n12\n" + "".join(f"{a} {b}\n" for a, b in points))
case("points", "slicer.fcsv", np.c_[points, np.full(12, 0.5)], lambda p: "# Markups fiducial file version = 4.11\n# columns = id,x,y,z,label,desc\n"
     + "".join(f"{k},{a},{b},0.5,F-{k},\n" for k, (a, b) in enumerate(points)))
case("points", "trackmate_7.csv", points * 1e-6, lambda p: "LABEL,ID,POSITION_X,POSITION_Y\nLabel,Spot ID,X,Y\nLabel,Spot ID,X,Y\n,,(micron),(micron)\n"
     + "".join(f"ID{k},{k},{a},{b}\n" for k, (a, b) in enumerate(points)))
holes = frame.copy()
holes.loc[4, "x"] = np.nan
for word in ["", "nan", "NaN", "NA", "N/A", "null", "-", "1.#QNAN"]:
    case("points", f"hole_{len(cases)}.csv", holed, lambda p: holes.to_csv(p, index=False, na_rep=word))
tracks = pd.DataFrame({"y": np.r_[points[:, 1], points[:, 1]], "x": np.r_[points[:, 0], points[:, 0]],
                       "mass": 9.0, "frame": np.repeat([0, 1], 12), "particle": np.r_[range(12), range(12)]})
case("points", "trackpy.csv", "several frames", lambda p: tracks.to_csv(p))
case("points", "trackpy_one.csv", points, lambda p: tracks[:12].to_csv(p))
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

# Tables of other programs: names of rows, units in a line, other separators, numbers and names of coordinates.
rows = lambda form: "".join(form.format(k=k, x=x, y=y) for k, (x, y) in enumerate(points))
comma = lambda text: text.replace(".", ",")
for name, expected, text in [
    ("imagej.csv", points, " ,Area,Mean,X,Y\n" + rows("{k},5,100,{x},{y}\n")),
    ("r_table.txt", points, '"x" "y"\n' + rows('"{k}" {x} {y}\n')),
    ("r_csv.csv", points, '"","x","y"\n' + rows('"{k}",{x},{y}\n')),
    ("pandas_text.txt", points, frame.to_string()),
    ("pandas_array.csv", points, pd.DataFrame(points).to_csv()),
    ("pandas_array_alone.csv", points, pd.DataFrame(points).to_csv(index=False)),
    ("pandas_quoted.csv", points, frame.to_csv(index=False, quoting=1)),
    ("origin.txt", points * 1e-3, "x\ty\nmm\tmm\nA\tB\n" + rows("{x}\t{y}\n")),
    ("excel_separator.csv", points, "sep=;\nx;y\n" + comma(rows("{x};{y}\n"))),
    ("old_mac.csv", points, "x,y\r" + rows("{x},{y}\r")),
    ("dos_end.csv", points, "x,y\r\n" + rows("{x},{y}\r\n") + "\x1a"),
    ("fortran.txt", points, "".join(f"  {x:.8e}  {y:.8e}\n".replace("e", "D") for x, y in points)),
    ("matlab_ascii.txt", points, "".join(f"   {x:.7e}   {y:.7e}\n" for x, y in points)),
    ("pipes.txt", points, "x|y\n" + rows("{x}|{y}\n")),
    ("slashes.csv", points, "// made by a rig\nx,y\n" + rows("{x},{y}\n")),
    ("dice_header.txt", points, "***\n*** DICe\n***\nID,COORDINATE_X,COORDINATE_Y,SIGMA\n" + rows("{k},{x},{y},0.1\n")),
    ("no_break_space.csv", points, "x,y\n" + rows("\u00a0{x},{y}\u00a0\n")),
    ("trackmate_full.csv", np.c_[points, np.zeros(12)] * 1e-6,
     "LABEL,ID,TRACK_ID,POSITION_X,POSITION_Y,POSITION_Z,FRAME\nLabel,Spot ID,Track ID,X,Y,Z,Frame\n,,,(micron),(micron),(micron),\n"
     + rows("ID{k},{k},,{x},{y},0,0\n")),
    ("row_column.csv", points, "label,row,col\n" + rows("{k},{y},{x}\n")),
    ("pivlab.txt", "--skip-lines 2", "PIVlab, ASCII chart output\nFRAME: 1\nx [px],y [px],u [px/frame],v [px/frame],vector type\n" + rows("{x},{y},0.1,0.2,1\n")),
    ("labview.lvm", "--skip-lines 9", "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\nDecimal_Separator\t,\n"
     "***End_of_Header***\t\n\t\nChannels\t2\n***End_of_Header***\nX_Value\tx\ty\tComment\n" + comma(rows("{k}\t{x}\t{y}\t\n"))),
    ("instron.csv", "--skip-lines 4", '"Results"\n"Specimen","gel"\n\n"Time","x","y"\n"(s)","(mm)","(mm)"\n' + rows('"{k}","{x}","{y}"\n')),
    ("cloud.ply", "--skip-lines 7", "ply\nformat ascii 1.0\nelement vertex 12\nproperty float x\nproperty float y\nproperty float z\nend_header\n" + rows("{x} {y} 0\n")),
    ("cloud.pcd", "--skip-lines 11", "# .PCD v.7\nVERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 12\nHEIGHT 1\n"
     "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 12\nDATA ascii\n" + rows("{x} {y} {k}\n")),
    ("thousands.csv", "line 2, column 1", "x;y\n" + rows("1.{k}10,50;{y}\n")),
    ("infinite.csv", "line 3, column 1", "x,y\n1,2\ninf,3\n4,5\n"),
    ("names.csv", "--columns", "id,lon,lat\n" + rows("{k},{x},{y}\n")),
    ("twice.csv", "more than one", "x,y,x\n" + rows("{x},{y},1\n")),
    ("one_unit.csv", "a unit of the column `y`", "x_mm,y\n" + rows("{x},{y}\n")),
    ("array.json", "JSON", json.dumps(points.tolist())),
    ("records.json", "JSON", frame.to_json(orient="records")),
    ("page.csv", "HTML", "<!DOCTYPE html><html></html>"),
    ("pointer.csv", "git lfs pull", "version https://git-lfs.github.com/spec/v1\noid sha256:ab\n"),
]:
    case("points", name, expected, lambda p: text.encode())
for x, y in [("cx", "cy"), ("X_pos", "Y_pos"), ("centroid_x", "centroid_y"), ("Pos. X [mm]", "Pos. Y [mm]"), ("x coordinate", "y coordinate"),
             ("Center_X", "Center_Y"), ("x/mm", "y/mm"), ("x in mm", "y in mm"), ("Position X", "Position Y")]:
    case("points", f"called_{len(cases)}.csv", points * (1e-3 if "mm" in x else 1), lambda p: f"id,{x},{y}\n" + rows("{k},{x},{y}\n"))
case("points", "records.npy", "astype(float)", lambda p: np.save(p, frame.to_records(index=False)))
case("points", "objects.npy", "astype(float)", lambda p: np.save(p, points.astype(object), allow_pickle=True))
case("points", "rate.npz", points, lambda p: np.savez(p, points=points, fps=30.0))
case("points", "rate.mat", points, lambda p: scipy.io.savemat(p, {"points": points, "fps": 30.0}))
case("points", "structure.mat", "save arrays of numbers", lambda p: scipy.io.savemat(p, {"data": {"x": 1.0}}))
case("points", "frame.pkl", "binary file", lambda p: frame.to_pickle(p))
case("points", "packed.csv.gz", "unpack it", lambda p: frame.to_csv(p))

# Points and where they go: stretched by 1 % along x.
moves = pd.DataFrame({**columns, "u": 0.01 * points[:, 0], "v": 0 * points[:, 1]})
case("moves", "moves.csv", 0.01005, lambda p: moves.to_csv(p, index=False))
case("moves", "moves.txt", 0.01005, lambda p: np.savetxt(p, moves, header="x y u v"))
case("moves", "moves_dice.csv", 0.01005, lambda p: moves.set_axis(["COORDINATE_X", "COORDINATE_Y", "DISPLACEMENT_X", "DISPLACEMENT_Y"], axis=1).to_csv(p))
case("moves", "moves_piv.txt", 0.01005, lambda p: moves.set_axis(["x [px]", "y [px]", "u [px/frame]", "v [px/frame]"], axis=1).to_csv(p, index=False))
case("moves", "moves.mat", 0.01005, lambda p: scipy.io.savemat(p, {name: moves[name].to_numpy() for name in moves}))
case("moves", "moves_none.csv", "a column named `u`", lambda p: frame.to_csv(p, index=False))

# Slopes of a dome, and its normal map.
down, right = np.mgrid[-1:1:32j, -1:1:48j]
p_slope, q_slope = -0.4 * right * np.exp(-right**2 - down**2), -0.4 * down * np.exp(-right**2 - down**2)
normals = np.stack([-p_slope, q_slope, np.ones_like(p_slope)], 2) / np.sqrt(1 + p_slope**2 + q_slope**2)[..., None]
case("normals", "normals.png", "up", lambda p: cv2.imwrite(str(p), np.round((normals + 1) / 2 * 255).astype("u1")[..., ::-1]) and None)
case("normals", "normals_16.png", "up", lambda p: cv2.imwrite(str(p), np.round((normals + 1) / 2 * 65535).astype("u2")[..., ::-1]) and None)
case("normals", "normals.tif", "up", lambda p: tifffile.imwrite(p, np.round((normals + 1) / 2 * 65535).astype("u2"), photometric="rgb"))
case("normals", "normals.npy", "up", lambda p: np.save(p, normals))
case("normals", "normals_down.npy", "down", lambda p: np.save(p, normals * [1, -1, 1]))
case("normals", "normals.mat", "up", lambda p: scipy.io.savemat(p, {"N": normals.astype("f4"), "light": [0.0, 0, 1]}))
case("normals", "normals_grey.png", "three channels", lambda p: iio.imwrite(p, np.zeros((8, 8), "u1")))

# Depth tables: 20 rows from 0 to 1.9 mm, in units of their heading.
grey, depth = np.arange(20) * 3.0, np.arange(20) * 0.1
depths = np.arange(12) * 4 / 30
for unit, factor, order in itertools.product(["mm", "um", "m"], [1], [0, 1]):
    scale = {"mm": 1, "um": 1e3, "m": 1e-3}[unit]
    both = [("darkness_grey_levels", grey), (f"depth_{unit}", depth * scale)][:: 1 - 2 * order]
    data, names = np.c_[both[0][1], both[1][1]], [both[0][0], both[1][0]]
    case("depth", f"depth_{unit}_{order}.csv", depths[11:], lambda p: pd.DataFrame(data, columns=names).to_csv(p, index=False))
    case("depth", f"depth_comment_{unit}_{order}.txt", depths[11:],
         lambda p: np.savetxt(p, data, delimiter=",", header=",".join(names)))

# Frames: 12 of 32 × 48 pixels, in the middle darker by 4 from one to the next. As many tenths of a millimetre deep.
dome = np.maximum(1 - (np.hypot(*np.mgrid[-16:16, -24:24]) / 12) ** 4, 0)
frames = [np.round(150 - 4 * k * dome).astype("u1") for k in range(12)]
jpegs = [cv2.imencode(".jpg", f, [cv2.IMWRITE_JPEG_QUALITY, 98])[1].tobytes() for f in frames]
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


case("frames", "pipe.mjpeg", depths, lambda p: b"".join(jpegs))
case("frames", "pipe_png.bin", depths, lambda p: b"".join(pngs))
case("frames", "no_tables.mjpeg", depths, lambda p: b"".join(map(without_tables, jpegs)))
case("frames", "mjpg.avi", depths, lambda p: avi(b"MJPG", jpegs))
case("frames", "no_tables.avi", depths, lambda p: avi(b"MJPG", list(map(without_tables, jpegs))))
case("frames", "dropped.avi", np.delete(depths, [4, 5, 8]), lambda p: avi(b"MJPG", [b"" if k in (4, 5, 8) else j for k, j in enumerate(jpegs)]))
case("frames", "damaged.avi", np.delete(depths, 5), lambda p: avi(b"MJPG", [j[: len(j) // 2] if k == 5 else j for k, j in enumerate(jpegs)]))
half = bytes(32 * 48 // 2)
case("frames", "i420.avi", depths, lambda p: avi(b"I420", [f.tobytes() + half for f in frames], 12))
case("frames", "y800.avi", depths, lambda p: avi(b"Y800", [f.tobytes() for f in frames], 8))
case("frames", "yuy2.avi", depths, lambda p: avi(b"YUY2", [np.stack([f, f * 0 + 128], 2).tobytes() for f in frames], 16))
case("frames", "uyvy.avi", depths, lambda p: avi(b"UYVY", [np.stack([f * 0 + 128, f], 2).tobytes() for f in frames], 16))
case("frames", "bgr.avi", depths, lambda p: avi(b"\0\0\0\0", [np.repeat(f[::-1, :, None], 3, 2).tobytes() for f in frames]))
for codec in [b"H264", b"FFV1", b"XVID", b"HFYU"]:
    case("frames", f"{codec.decode()}.avi", "ffmpeg -i", lambda p: avi(codec, jpegs))
for name, magic in [("mp4", bytes(4) + b"ftypisom"), ("mkv", b"\x1a\x45\xdf\xa3"), ("ogv", b"OggS"), ("gif", b"GIF89a"), ("bmp", b"BM" + bytes(9))]:
    case("frames", f"video.{name}", "not read", lambda p: magic + bytes(90))
stack = np.stack(frames)
case("frames", "stack.npy", depths, lambda p: np.save(p, stack))
case("frames", "stack.npz", depths, lambda p: np.savez_compressed(p, stack))
case("frames", "stack.tif", depths, lambda p: tifffile.imwrite(p, stack, photometric="minisblack"))
case("frames", "stack_lzw_free.tif", depths, lambda p: tifffile.imwrite(p, stack, compression="zlib", photometric="minisblack"))
case("frames", "stack.big.tif", "BigTIFF", lambda p: tifffile.imwrite(p, stack, bigtiff=True, photometric="minisblack"))
case("frames", "float.tif", "whole numbers", lambda p: tifffile.imwrite(p, stack.astype("f4"), photometric="minisblack"))
case("frames", "float64.tif", "whole numbers", lambda p: tifffile.imwrite(p, stack.astype("f8"), photometric="minisblack"))
case("frames", "signed.tif", "whole numbers", lambda p: tifffile.imwrite(p, stack.astype("i2"), photometric="minisblack"))
case("frames", "u32.tif", "whole numbers", lambda p: tifffile.imwrite(p, stack.astype("u4"), photometric="minisblack"))
case("frames", "ten_bits.tif", "bits", lambda p: tifffile.imwrite(p, stack.astype("u2") * 4, photometric="minisblack"))
case("frames", "twelve_bits.png", "bits", lambda p: iio.imwrite(p, frames[0].astype("u2") * 16))
case("frames", "stack_deflate.tif", depths, lambda p: tifffile.imwrite(p, stack, compression="deflate", photometric="minisblack"))
case("frames", "stack_imagej.tif", depths, lambda p: tifffile.imwrite(p, stack, imagej=True))
case("frames", "stack_ome.ome.tif", depths, lambda p: tifffile.imwrite(p, stack, photometric="minisblack", metadata={"axes": "TYX"}))
case("frames", "stack_rgb.tif", depths, lambda p: tifffile.imwrite(p, np.repeat(stack[..., None], 3, 3), photometric="rgb"))
case("frames", "stack_tiled.tif", depths, lambda p: tifffile.imwrite(p, stack, tile=(16, 16), photometric="minisblack"))
case("frames", "stack_inverted.tif", depths, lambda p: tifffile.imwrite(p, 255 - stack, photometric="miniswhite"))
case("frames", "stack_16.tif", depths, lambda p: tifffile.imwrite(p, stack.astype("u2") * 257, photometric="minisblack"))
case("frames", "stack_big_endian.tif", depths, lambda p: tifffile.imwrite(p, stack, byteorder=">", photometric="minisblack"))
case("frames", "stack_axes.npy", "rows", lambda p: np.save(p, np.moveaxis(stack, 0, 2)))
case("frames", "stack_fortran.npy", "C order", lambda p: np.save(p, np.asfortranarray(stack)))
case("frames", "stack_float.npy", "uint8 or uint16", lambda p: np.save(p, stack / 255))
case("frames", "stack_int.npy", "uint8 or uint16", lambda p: np.save(p, stack.astype("i8")))
case("frames", "stack_colour.npy", depths, lambda p: np.save(p, np.repeat(stack[..., None], 3, 3)))
case("frames", "stack_16.npy", depths, lambda p: np.save(p, stack.astype("u2") * 257))
case("frames", "progressive.jpg", depths[11:], lambda p: cv2.imencode(".jpg", frames[11], [cv2.IMWRITE_JPEG_PROGRESSIVE, 1])[1].tobytes())
case("frames", "grey_alpha.png", depths[11:], lambda p: iio.imwrite(p, np.stack([frames[11], frames[11] * 0 + 255], 2)))
case("frames", "colour.png", depths[11:], lambda p: cv2.imwrite(str(p), np.repeat(frames[11][..., None], 3, 2)) and None)
case("frames", "frame.bmp", "save it as PNG", lambda p: cv2.imencode(".bmp", frames[11])[1].tobytes())
case("frames", "frame.webp", "save it as PNG", lambda p: cv2.imencode(".webp", frames[11])[1].tobytes())
case("frames", "frame.jp2", "export it", lambda p: cv2.imencode(".jp2", frames[11])[1].tobytes())
case("frames", "frames.gif", "save its frames as PNG", lambda p: iio.imwrite(p, stack, extension=".gif"))
for codec, name, expected in [("MJPG", "opencv.avi", depths), ("FFV1", "opencv_ffv1.avi", "ffmpeg -i"), ("XVID", "opencv_xvid.avi", "ffmpeg -i"),
                              ("mp4v", "opencv.mp4", "ffmpeg -i"), ("FFV1", "opencv.mkv", "ffmpeg -i")]:
    def video(p):
        writer = cv2.VideoWriter(str(p), cv2.VideoWriter_fourcc(*codec), 25, (48, 32), isColor=True)
        for f in frames:
            writer.write(np.repeat(f[..., None], 3, 2))
        writer.release()
    case("frames", name, expected, video)
case("frames", "y4m_420.y4m", depths, lambda p: b"YUV4MPEG2 W48 H32 F25:1 C420jpeg\n" + b"".join(b"FRAME\n" + f.tobytes() + bytes([128]) * 768 for f in frames))
case("frames", "netpbm_text.pgm", depths[11:], lambda p: "P2\n48 32\n255\n" + " ".join(map(str, frames[11].ravel())))
case("frames", "hdf5_frames.h5", "HDF5", lambda p: b"\x89HDF\r\n\x1a\n" + bytes(60))
def archive(p):
    with zipfile.ZipFile(p, "w") as file:
        file.writestr("frame.png", pngs[0])


case("frames", "archive.zip", "an array of frames", archive)
case("frames", "cut_in_half.jpg", "cut short", lambda p: jpegs[11][: len(jpegs[11]) * 3 // 4])
case("frames", "table_for_frames.csv", "a text that begins", lambda p: frame.to_csv(p, index=False))
case("frames", "truncated.jpg", "cannot use the image", lambda p: jpegs[0][:300])

(folder / "cases.txt").write_text("".join(f"{kind} {path}\n" for kind, path, _ in cases))
print(len(cases), "files in", folder)


def read(program, kind, path):
    """Exit code, and the numbers that were read, or the sentence."""
    reference, out = folder / "reference.png", folder / "out"
    iio.imwrite(reference, frames[0])
    table = folder / "depth_mm_0.csv"
    depth = ["depth", "--reference", reference, "--pixel-um", "100", "--table"]
    call = {"points": ["warp", path, path, path, "--out", out], "depth": [*depth, path, folder / "colour.png"], "frames": [*depth, table, path],
            "moves": ["strain", path], "normals": ["integrate", path]}[kind]
    done = subprocess.run([program, *map(str, call), "--json"], capture_output=True, text=True)
    if done.returncode == 2 or not done.stdout.strip():
        return done.returncode, done.stderr
    answer = json.loads(done.stdout)
    if kind == "points":
        found = np.genfromtxt(out / "warped.csv", delimiter=",", names=True)
        return done.returncode, np.stack([found[name] for name in found.dtype.names if len(name) == 2], 1)
    if kind == "moves":
        return done.returncode, answer["strain"]["components"]["e_xx"]["value"]
    if kind == "normals":
        return done.returncode, answer["cautions"][0]["y"] if answer["slope_rms"] < 0.02 else f"slopes off by {answer['slope_rms']}"
    contacts = [frame["contact"] for frame in answer["frames"]]
    return done.returncode, np.array([1e3 * contact["indentation_m"]["value"] if contact else 0.0 for contact in contacts])


if len(sys.argv) > 2:
    wrong = 0
    for kind, path, expected in cases:
        code, found = read(sys.argv[2], kind, path)
        if isinstance(expected, str) and kind != "normals" or isinstance(found, str) and code == 2:
            fits = code == 2 and expected in found and found.count("\n") == 1 and not FOREIGN.search(found.replace(path.name, ""))
        elif isinstance(expected, str):
            fits = found == expected
        else:
            # Depths are known to a grey level, and faint contacts are none.
            close = dict(rtol=0, atol=0.3 if kind == "frames" else 0.05) if kind in ("frames", "depth") else dict(rtol=1e-4, atol=0)
            fits = code in (0, 1) and np.shape(found) == np.shape(expected) and np.allclose(found, expected, **close)
        wrong += not fits
        if not fits:
            print(f"{path.name}: expected {expected}, found {found} (exit code {code})")
    print(len(cases) - wrong, "of", len(cases), "as they should be")
    sys.exit(wrong > 0)
