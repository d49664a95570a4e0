#!/usr/bin/env python3
"""Files of points, tables and frames as written by other programs, and their results in the program.

    python3 -m venv V && V/bin/pip install numpy pandas scipy opencv-python-headless tifffile imageio
    V/bin/python evidence/file_formats.py FOLDER [PROGRAM]

Writes the files to FOLDER. PROGRAM (`target/release/tactile`) reads each file. The result must follow from the numbers in the file,
or the file is refused with exit code 2 and one sentence. The sentence must contain the remedy and no message of a library.
"""
import itertools, json, pathlib, re, subprocess, sys, zipfile
import cv2, imageio.v3 as iio, numpy as np, pandas as pd, scipy.io, tifffile

folder = pathlib.Path(sys.argv[1])
folder.mkdir(parents=True, exist_ok=True)
cases = []  # kind of reading, file, numbers that are read, or words of the refusal

# Words of readers and decoders that must not occur in a message.
FOREIGN = re.compile(r"Unknown\(|Some\(|None|Err\(|panicked|component Y|ColorType|Format error|invalid digit|decoding|os error 22|TiffError")


def case(kind, name, expected, write):
    path = folder / name
    content = write(path)
    if isinstance(content, str):
        content = content.encode()
    if isinstance(content, bytes):
        path.write_bytes(content)
    cases.append((kind, path, expected))


# Points: 12 in the plane, with coordinates that occur in no other column.
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
case("points", "records.npy", "numpy.savez", lambda p: np.save(p, frame.to_records(index=False)))
case("points", "objects.npy", "astype(float)", lambda p: np.save(p, points.astype(object), allow_pickle=True))
case("points", "rate.npz", points, lambda p: np.savez(p, points=points, fps=30.0))
case("points", "rate.mat", points, lambda p: scipy.io.savemat(p, {"points": points, "fps": 30.0}))
case("points", "structure.mat", "save arrays of numbers", lambda p: scipy.io.savemat(p, {"data": {"x": 1.0}}))
case("points", "frame.pkl", "binary file", lambda p: frame.to_pickle(p))
case("points", "packed.csv.gz", "unpack it", lambda p: frame.to_csv(p))

# Points with displacements: a stretch by 1 % along x.
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

# Frames: 12 of 32 × 48 pixels, whose middle darkens by 4 from one to the next. Each step is a tenth of a millimetre deep.
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

# Further tables: byte order marks and line ends, quotes, several lines of headings, numbers in other notations, other kinds of
# arrays.
euro = comma(rows("{x};{y}\n"))
for name, expected, text in [
    ("excel_german.csv", points * 1e-3, ("\ufeff\"x [mm]\";\"y [mm]\"\n" + euro).replace("\n", "\r\n")),
    ("excel_french.csv", points, "\ufeffx;y;remarque\r\n" + comma(rows("{x};{y};point {k}\r\n"))),
    ("quoted_comma.csv", points, '"note, free",x,y\n' + rows('"gel, soft",{x},{y}\n')),
    ("quoted_decimals.csv", points, '"x","y"\n' + comma(rows('"{x}";"{y}"\n')).replace('"x","y"', '"x";"y"')),
    ("quoted_thousands.csv", "line 2, column 1", 'x,y\n' + rows('"1,{k}00.5",{y}\n')),
    ("mixed_decimals.csv", "a decimal comma", "x;y\n1,234;2.5\n2,345;3.5\n4,5;1.5\n"),
    ("apostrophes.csv", "line 2, column 1", "x;y\n" + rows("1'{k}00.5;{y}\n")),
    ("blank_thousands.csv", "line 2, column 1", "x;y\n" + rows("1 {k}00,5;{y}\n")),
    ("hexadecimal.csv", "line 2, column 1", "x,y\n" + rows("0x{k}F,{y}\n")),
    ("with_units.csv", "line 2, column 1", "x,y\n" + rows("{x} mm,{y} mm\n")),
    ("percent.csv", "line 2, column 1", "x,y\n" + rows("{x}%,{y}%\n")),
    ("signs.csv", points, "x,y\n" + rows("+{x},+{y}\n")),
    ("exponents.csv", points, "x,y\n" + "".join(f"{x:E},{y:.12e}\n" for x, y in points)),
    ("half_numbers.csv", [[0.5, 1.0], [1.5, 2.0], [3.0, 4.5]], "x,y\n.5,1.\n1.5,2.\n3.,4.5\n"),
    ("typeset_minus.csv", points * [-1, 1], "x,y\n" + rows("\u2212{x},{y}\n")),
    ("errors.csv", [[1.0, 2.0], [3.0, 4.5], [4.0, 5.0]], "x,y\n1,2\n3,4.5\n#DIV/0!,3\n4,5\n#N/A,7\n"),
    ("hole_ind.csv", points, "x,y\n-nan,3\nnan(ind),3\n".replace("nan(ind),3\n", "") + rows("{x},{y}\n")),
    ("overflow.csv", "line 2, column 1", "x,y\n1e400,2\n1,2\n"),
    ("trailing_commas.csv", points, "x,y,\n" + rows("{x},{y},\n")),
    ("trailing_many.csv", points, "x,y,,,\n" + rows("{x},{y},,,\n")),
    ("trailing_rows.csv", points, "x,y\n" + rows("{x},{y},\n")),
    ("ragged_short.csv", "line 3", "x,y,z\n1,2,3\n4,5\n6,7,8\n"),
    ("ragged_long.csv", "line 3", "x,y\n1,2\n3,4,5\n6,7\n"),
    ("blank_lines.csv", points, "\n\nx,y\n\n" + rows("{x},{y}\n\n")),
    ("heading_again.csv", "line 14, column 1", "x,y\n" + rows("{x},{y}\n") + "x,y\n1,2\n"),
    ("multiindex.csv", points, pd.DataFrame(np.c_[points, points[:, :1]], columns=pd.MultiIndex.from_tuples([("a", "x"), ("a", "y"), ("b", "q")])).to_csv(index=False)),
    ("multiindex_2.csv", points, pd.DataFrame(points, columns=pd.MultiIndex.from_tuples([("a", "x"), ("a", "y")])).to_csv(index=False)),
    ("multiindex_rows.csv", points, frame.set_index(pd.MultiIndex.from_product([["a", "b"], range(6)])).to_csv()),
    ("deeplabcut.csv", points, "scorer,DLC,DLC,DLC\nbodyparts,dot,dot,dot\ncoords,x,y,likelihood\n" + rows("{k},{x},{y},0.99\n")),
    ("sleap.csv", points, "track,frame_idx,instance.score,nose.x_1,nose.y_1\n" + rows(",{k},0.9,{x},{y}\n")),
    ("index_name.csv", points, frame.rename_axis("id").to_csv()),
    ("pandas_long_float.csv", points, frame.to_csv(float_format="%.17g")),
    ("times.csv", points, "time,x,y\n" + rows("2024-05-01 12:00:{k}.5,{x},{y}\n")),
    ("booleans.csv", points, "x,y,seen\n" + rows("{x},{y},True\n")),
    ("imagej_index.csv", points, "\tX\tY\n" + rows("{k}\t{x}\t{y}\n")),
    ("comment_marks.txt", points, "% rig 7\n# x y\n" + rows("{x} {y}\n")),
    ("comment_end.csv", points, "x,y\n" + rows("{x},{y}\n") + "# end\n"),
    ("aligned_comma.csv", points, "     x,      y\n" + rows("  {x},  {y}\n")),
    ("aligned_tab.txt", points, "x\t\ty\n".replace("\t\t", "\t") + rows("{x} \t {y}\n")),
    ("names_of_words.txt", "columns", "Position X   Position Y\n" + rows("{x}   {y}\n")),
    ("wavefront.obj", "columns", rows("v {x} {y} 0\n")),
    ("molecule.xyz", "--skip-lines 2", "12\nfrom a tracker\n" + rows("{k} {x} {y} 0\n")),
    ("shape.off", "--skip-lines", "OFF\n12 0 0\n" + rows("{x} {y} {k}\n")),
    ("legacy.vtk", "--skip-lines", "# vtk DataFile Version 3.0\npoints\nASCII\nDATASET POLYDATA\nPOINTS 12 float\n" + rows("{x} {y} {k}\n")),
    ("pretty.json", "JSON", json.dumps(points.tolist(), indent=2)),
    ("flat.json", "JSON", json.dumps(points[:, 0].tolist())),
    ("lines.jsonl", "JSON", frame.to_json(orient="records", lines=True)),
    ("list_of_one.json", "JSON", '["x", "y"]'),
    ("data.xml", "XML", '<?xml version="1.0"?><points/>'),
    ("data.yaml", "columns", "x:\n - 1\n - 2\n"),
    ("latex.tex", points, "x & y \\\\\n" + rows("{x} & {y} \\\\\n")),
    ("spaces_only.csv", "at least one row", "   \n  \n"),
    ("heading_only.csv", "at least one row", "x,y\n"),
    ("holes_only.csv", "at least one row", "x,y\nnan,nan\n,\n"),
    ("comments_only.txt", "at least one row", "# x y\n# none\n"),
]:
    case("points", name, np.array(expected) if isinstance(expected, list) else expected, lambda p: text.encode())
for encoding, expected in [("utf-16-le", "export it as CSV"), ("utf-32", "UTF-16"), ("cp1252", points)]:
    case("points", f"{encoding}.csv", expected, lambda p: frame.to_csv(p, index=False, encoding=encoding))
for dtype in ["<f2", "<i8", "<u4", ">i2", ">f4", "?"]:
    for order in "CF":
        numbers = points if dtype != "?" else points * 0 + [[1, 0]] * 12
        expected = "astype(float)" if dtype == "<f2" else numbers.astype(dtype).astype(float)
        if dtype != "?":
            case("points", f"array_{len(cases)}.npy", expected, lambda p: np.save(p, np.asarray(points.astype(dtype), order=order)))
structured = np.rec.fromarrays([points[:, 0], points[:, 1], np.arange(12)], dtype=[("x", "<f8"), ("y", "<f8"), ("id", "<i4")])
case("points", "structured.npy", "numpy.savez", lambda p: np.save(p, np.array(structured)))
case("points", "structured.npz", "save arrays of numbers", lambda p: np.savez(p, tracks=np.array(structured)))
case("points", "text.npy", "astype(float)", lambda p: np.save(p, np.array(["a", "b"])))
case("points", "dates.npy", "astype(float)", lambda p: np.save(p, np.array(["2024-01-01"], "M8[D]")))
case("points", "none.npy", "at least one row", lambda p: np.save(p, np.zeros((0, 2))))
case("points", "none.npz", "at least one row", lambda p: np.savez(p, points=np.zeros((0, 2))))
case("points", "none.mat", "at least one row", lambda p: scipy.io.savemat(p, {"points": np.zeros((0, 2))}))
case("points", "holes.npy", holed, lambda p: np.save(p, holes.to_numpy()))
case("points", "all_holes.npy", "at least one row", lambda p: np.save(p, points * np.nan))
case("points", "infinite.npy", "line 3, column 2", lambda p: np.save(p, np.array([[1, 2], [3, 4], [5, np.inf]])))
case("points", "beside_text.npz", points, lambda p: np.savez(p, points=points, name="gel", unit=np.array(["mm"])))
case("points", "complex.mat", "array of numbers", lambda p: scipy.io.savemat(p, {"points": points + 1j}))
case("points", "cell.mat", "save arrays of numbers", lambda p: scipy.io.savemat(p, {"c": np.array([points, points[:3]], dtype=object)}))
case("points", "sparse.mat", "save arrays of numbers", lambda p: scipy.io.savemat(p, {"s": scipy.sparse.csc_matrix(points)}))
case("points", "level_4.mat", "export it as CSV", lambda p: scipy.io.savemat(p, {"points": points}, format="4"))
for dtype in ["i1", "u2", "i4", "i8", "f4"]:
    case("points", f"kind_{dtype}.mat", points.astype(dtype).astype(float), lambda p: scipy.io.savemat(p, {"points": points.astype(dtype)}))
case("points", "text_beside.mat", points, lambda p: scipy.io.savemat(p, {"points": points, "name": "gel", "settings": {"a": 1.0}}))


def spreadsheet(names):
    def write(p):
        with zipfile.ZipFile(p, "w", zipfile.ZIP_DEFLATED) as file:
            for name in names:
                file.writestr(name, "<xml/>")
    return write


case("points", "book.xlsx", "saved as CSV", spreadsheet(["[Content_Types].xml", "xl/workbook.xml", "xl/worksheets/sheet1.xml"]))
case("points", "book.ods", "saved as CSV", spreadsheet(["mimetype", "content.xml"]))
for name, magic in [("table.parquet", b"PAR1\x15\x04"), ("table.feather", b"ARROW1\0\0"), ("book.xls", b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"), ("table.sqlite", b"SQLite format 3\0")]:
    case("points", name, "export it as CSV", lambda p: magic + bytes(range(256)) * 4)
for module, end in [("bz2", "bz2"), ("lzma", "xz")]:
    case("points", f"packed.csv.{end}", "export it as CSV", lambda p: __import__(module).compress(frame.to_csv(index=False).encode()))
case("normals", "normals.npz", "up", lambda p: np.savez(p, n=normals, mask=np.ones((32, 48), bool)))
case("normals", "normals_axes.npy", "up", lambda p: np.save(p, np.moveaxis(normals, 2, 0)))
case("normals", "normals_fortran.npy", "up", lambda p: np.save(p, np.asfortranarray(normals.astype(">f4"))))
case("normals", "normals_alpha.png", "up", lambda p: cv2.imwrite(str(p), np.round((np.dstack([normals[..., ::-1], normals[..., 2] * 0 + 1]) + 1) / 2 * 255).astype("u1")) and None)
case("normals", "normals_table.npy", "shape (rows, columns, 3)", lambda p: np.save(p, points))
for name, text in [("brackets", "darkness [grey_levels];depth [mm]\n"), ("slash", "Darkness/px;Depth/mm\n"), ("plain", "darkness;depth\n")]:
    case("depth", f"depth_{name}.csv", depths[11:], lambda p: text + comma("".join(f"{g};{d:.3f}\n" for g, d in zip(grey, depth))))
case("depth", "depth_feet.csv", "m or a multiple", lambda p: "darkness,depth (ft)\n" + "".join(f"{g},{d}\n" for g, d in zip(grey, depth)))

# Further frames: kinds of PNG, JPEG, TIFF, YUV4MPEG2, AVI and NPY.
from PIL import Image

last = Image.fromarray(frames[11])
tinted = np.stack([frames[11], frames[11], frames[11]], 2)
for name, image in [("palette.png", last.convert("P")), ("rgba.png", last.convert("RGBA")), ("adaptive.png", last.convert("RGB").quantize(200)),
                    ("palette.tif", last.convert("P")), ("rgba.tif", last.convert("RGBA"))]:
    case("frames", name, depths[11:] if name != "palette.tif" else "it is stored in a way that is not read", lambda p: image.save(p))
case("frames", "sixteen_alpha.png", depths[11:], lambda p: cv2.imwrite(str(p), np.dstack([tinted.astype("u2") * 257, np.full((32, 48), 65535, "u2")])) and None)
case("frames", "one_bit.png", depths[11:] * 0 + 1.9, lambda p: Image.fromarray(frames[11] > 140).save(p))
for turn in [1, 3]:
    exif = Image.Exif()
    exif[0x0112] = turn
    case("frames", f"exif_{turn}.jpg", depths[11:], lambda p: last.save(p, quality=98, exif=exif))
sideways = Image.Exif()
sideways[0x0112] = 6
case("frames", "exif_6.jpg", depths[11:], lambda p: Image.fromarray(np.rot90(frames[11]).copy()).save(p, quality=98, exif=sideways))
case("frames", "cmyk.jpg", depths[11:], lambda p: last.convert("CMYK").save(p, quality=98))
case("frames", "restart.jpg", depths[11:], lambda p: cv2.imencode(".jpg", frames[11], [cv2.IMWRITE_JPEG_RST_INTERVAL, 2, cv2.IMWRITE_JPEG_QUALITY, 98])[1].tobytes())
case("frames", "animated.png", "frames as PNG", lambda p: last.save(p, save_all=True, append_images=[Image.fromarray(f) for f in frames[:3]]))
case("frames", "animated.gif", "save its frames as PNG", lambda p: last.save(p, save_all=True, append_images=[Image.fromarray(f) for f in frames[:3]]))
case("frames", "animated.webp", "save it as PNG", lambda p: last.save(p, save_all=True, append_images=[Image.fromarray(f) for f in frames[:3]]))
case("frames", "multipart.mjpeg", depths, lambda p: b"".join(b"--frame\r\nContent-Type: image/jpeg\r\n\r\n" + j + b"\r\n" for j in jpegs))
case("frames", "damaged.png", "damaged", lambda p: pngs[11][:60] + bytes([pngs[11][60] ^ 255]) + pngs[11][61:])
case("frames", "cut.png", "damaged or cut", lambda p: pngs[11][: len(pngs[11]) // 2])
for compression in ["lzw", "packbits", "jpeg", "zstd", "webp", "lzma"]:
    read_too = compression in ("lzw", "packbits", "jpeg")
    case("frames", f"pressed_{compression}.tif", depths if read_too else "it is stored in a way that is not read",
         lambda p: tifffile.imwrite(p, stack if compression != "webp" else np.repeat(stack[..., None], 3, 3), compression=compression,
                                    photometric="minisblack" if compression != "webp" else "rgb"))
case("frames", "predictor.tif", depths, lambda p: tifffile.imwrite(p, stack, compression="lzw", predictor=2, photometric="minisblack"))
case("frames", "strips.tif", depths, lambda p: tifffile.imwrite(p, stack, rowsperstrip=5, photometric="minisblack"))
case("frames", "planes.tif", depths, lambda p: tifffile.imwrite(p, np.repeat(stack[:, None], 3, 1), photometric="rgb", planarconfig="separate"))
case("frames", "imagej_one_page.tif", depths[:1], lambda p: tifffile.imwrite(p, stack, imagej=True, truncate=True))
case("frames", "cut.tif", "cut short", lambda p: p.write_bytes((folder / "strips.tif").read_bytes()[:700]) and None)


def mixed(p):
    with tifffile.TiffWriter(p) as file:
        for k, f in enumerate(frames):
            file.write(f, photometric="minisblack", contiguous=False)
            if k == 4:
                file.write(f[::4, ::4], photometric="minisblack", contiguous=False)


case("frames", "mixed_sizes.tif", depths, mixed)
quarter, halves, fulls = bytes([128]) * 768, bytes([128]) * 1536, bytes([128]) * 3072
deep = lambda bits: [(f.astype("<u2") << (bits - 8)).tobytes() for f in frames]
eight = [f.tobytes() for f in frames]
for space, luma, rest in [("mono", eight, b""), ("422", eight, halves), ("444", eight, fulls), ("411", eight, quarter), ("420mpeg2", eight, quarter), ("420paldv", eight, quarter),
                          ("444alpha", eight, fulls + fulls[:1536]), ("420p10", deep(10), quarter * 2), ("422p12", deep(12), halves * 2), ("444p16", deep(16), fulls * 2), ("mono10", deep(10), b""), ("mono16", deep(16), b"")]:
    case("frames", f"space_{space}.y4m", depths, lambda p: b"YUV4MPEG2 W48 H32 F25:1 Ip A1:1 C" + space.encode() + b" XYSCSS=420JPEG\n" + b"".join(b"FRAME Ippp\n" + d + rest for d in luma))
case("frames", "space_none.y4m", depths, lambda p: b"YUV4MPEG2 W48 H32 F25:1\n" + b"".join(b"FRAME\n" + d + quarter for d in eight))
case("frames", "space_rgb.y4m", "colour space", lambda p: b"YUV4MPEG2 W48 H32 F25:1 Crgb\n" + b"".join(b"FRAME\n" + d * 3 for d in eight))


def with_sound(data, odd=b"", second=b""):
    """An AVI file whose first stream is sound, with index, padding, lists of records and a further part."""
    plain = avi(b"MJPG", data)
    movi = plain.index(b"movi") + 4
    sound = chunk(b"LIST", b"strl" + chunk(b"strh", b"auds" + bytes(52)) + chunk(b"strf", bytes(18)))
    at = plain.index(b"LIST", plain.index(b"avih"))
    frames_in = b"".join(chunk(b"01wb"[:0] + b"00wb", b"pcm" + odd) + chunk(b"LIST", b"rec " + chunk(b"01dc", d)) + chunk(b"JUNK", b"x" * 7) for d in data)
    head = plain[12 : movi - 12]
    head = head[: at - 12] + sound + head[at - 12 :]
    return chunk(b"RIFF", b"AVI " + head + chunk(b"LIST", b"movi" + frames_in) + chunk(b"idx1", bytes(32))) + second


case("frames", "sound.avi", depths, lambda p: with_sound(jpegs))
case("frames", "sound_odd.avi", depths, lambda p: with_sound(jpegs, b"??"))
case("frames", "dib_names.avi", depths, lambda p: avi(b"DIB ", [np.repeat(f[::-1, :, None], 3, 2).tobytes() for f in frames]).replace(b"00dc", b"00db"))
case("frames", "grey_8.avi", "ffmpeg -i", lambda p: avi(b"\0\0\0\0", [f[::-1].tobytes() for f in frames], 8))
case("frames", "bgra.avi", "ffmpeg -i", lambda p: avi(b"\0\0\0\0", [np.repeat(f[::-1, :, None], 4, 2).tobytes() for f in frames], 32))
case("frames", "nv12.avi", depths, lambda p: avi(b"NV12", [f.tobytes() + half for f in frames], 12))
case("frames", "open_end.avi", depths, lambda p: avi(b"MJPG", jpegs).replace(len(jpegs).to_bytes(4, "little") + bytes(4) + (1).to_bytes(4, "little"), bytes(8) + (1).to_bytes(4, "little"), 1))
case("frames", "one_axis.npy", depths, lambda p: np.save(p, stack[..., None]))
case("frames", "rgba.npy", "uint8 or uint16", lambda p: np.save(p, np.repeat(stack[..., None], 4, 3)))
case("frames", "bool.npy", "uint8 or uint16", lambda p: np.save(p, stack > 100))
case("frames", "big_endian.npy", depths, lambda p: np.save(p, (stack.astype("u2") * 257).astype(">u2")))
case("frames", "version_2.npy", depths, lambda p: np.lib.format.write_array(open(p, "wb"), stack, version=(2, 0)))
case("frames", "with_times.npz", depths, lambda p: np.savez(p, times=np.arange(12.0), frames=stack, numbers=np.arange(12)))
case("frames", "one_by_one.npz", depths, lambda p: np.savez(p, *frames))
case("frames", "no_frames.npy", "at least one frame", lambda p: np.save(p, stack[:0]))
case("frames", "frames.mat", "numpy.save", lambda p: scipy.io.savemat(p, {"frames": stack}))
case("frames", "packed.y4m.gz", "unpack it", lambda p: __import__("gzip").compress(b"YUV4MPEG2 W48 H32\n"))
for name, magic in [("photo.heic", bytes(4) + b"ftypheic"), ("photo.avif", bytes(4) + b"ftypavif"), ("wide.hdr", b"#?RADIANCE\n"), ("wide.exr", b"\x76\x2f\x31\x01"), ("icon.ico", b"\0\0\1\0")]:
    case("frames", name, "PNG" if name[:4] != "phot" else "not read", lambda p: magic + bytes(range(200, 256)) * 9)
pam = b"P7\nWIDTH 48\nHEIGHT 32\nDEPTH 1\nMAXVAL 255\nTUPLTYPE GRAYSCALE\nENDHDR\n" + eight[11]
case("frames", "grey.pam", depths[11:], lambda p: pam)
case("frames", "two.pam", "write binary PGM", lambda p: pam[:-1536] + eight[10] + pam)
case("frames", "bits.pbm", depths[:1], lambda p: b"P4\n48 32\n" + bytes(192))
case("frames", "float.pfm", "PNG", lambda p: b"Pf\n48 32\n-1.0\n" + frames[11].astype("<f4").tobytes())
case("frames", "twelve.pgm", depths, lambda p: b"".join(b"P5\n# rig\n48 32\n4095\n" + (np.round(f / 255 * 4095).astype(">u2")).tobytes() for f in frames))
case("frames", "pipe.ppm", depths, lambda p: b"".join(b"P6 48 32 255\n" + np.repeat(f[..., None], 3, 2).tobytes() for f in frames))
case("frames", "text.ppm", depths[11:], lambda p: "P3\n48 32\n255\n" + " ".join(map(str, np.repeat(frames[11][..., None], 3, 2).ravel())))

(folder / "cases.txt").write_text("".join(f"{kind} {path}\n" for kind, path, _ in cases))
print(len(cases), "files in", folder)


def read(program, kind, path):
    """Exit code, and the numbers read or the error message."""
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
            fits = code == 2 and isinstance(expected, str) and expected in found and found.count("\n") == 1 and not FOREIGN.search(found.replace(path.name, ""))
        elif isinstance(expected, str):
            fits = found == expected
        else:
            # Depths are accurate to a grey level, and faint contacts are not detected.
            close = dict(rtol=0, atol=0.3 if kind == "frames" else 0.05) if kind in ("frames", "depth") else dict(rtol=1e-4, atol=0)
            fits = code in (0, 1) and np.shape(found) == np.shape(expected) and np.allclose(found, expected, **close)
        wrong += not fits
        if not fits:
            print(f"{path.name}: expected {expected}, found {found} (exit code {code})")
    print(len(cases) - wrong, "of", len(cases), "as they should be")
    sys.exit(wrong > 0)
