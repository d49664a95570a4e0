#!/usr/bin/env python3
"""Writes the small inputs in examples/data that are used in the help of the program `tactile`.

    evidence/example_data.py          write them
    evidence/example_data.py --check  fail if a file differs from the output of this script

It uses only the standard library and writes the same bytes everywhere.
"""
import math
import pathlib
import struct
import sys
import zlib

FOLDER = pathlib.Path(__file__).parent.parent / "examples" / "data"


def scattered(k, step):
    """The k-th of evenly scattered numbers between 0 and 1."""
    return (0.5 + k * step) % 1.0


def error(k, step):
    """A number in place of a measurement error, scattered between -1/2 and 1/2."""
    return scattered(k, step) - 0.5


def place(k):
    """Point k of a field of 10 by 10."""
    return 10 * scattered(k, 0.7548776662), 10 * scattered(k, 0.5698402910)


def moved(k):
    """Position of point k after the deformation: 5 % longer along x, 2 % shorter along y, sheared, and with a reading error."""
    x, y = place(k)
    return 1.05 * x + 0.02 * y + 0.01 * error(k, 0.831), 0.98 * y + 0.3 + 0.01 * error(k, 0.417)


def points(rows):
    return "id,x_mm,y_mm\n" + "".join(f"{k},{x:.4f},{y:.4f}\n" for k, (x, y) in rows)


def cases():
    rows = [f"m {x:.4f} {y:.4f}" for x, y in map(place, range(60))]
    # The targets are in another order.
    rows += [f"t {x:.4f} {y:.4f}" for x, y in (moved(37 * k % 60) for k in range(60))]
    space = [(x, y, 0.02 * ((x - 5) ** 2 + (y - 5) ** 2)) for x, y in map(place, range(50))]
    rows.append("case pressed 3 50 50")
    rows += [f"m {x:.4f} {y:.4f} {z:.4f}" for x, y, z in space]
    rows += [f"t {1.03 * x:.4f} {1.03 * y:.4f} {0.9 * z:.4f}" for x, y, z in reversed(space)]
    return "case stretched 2 60 60\n" + "\n".join(rows) + "\n"


def slopes(along_x):
    """Slopes of the saddle 0.005 x² + 0.01 y² about the middle of 24 rows and 32 columns."""
    cell = (lambda r, c: 0.01 * (c - 15.5)) if along_x else (lambda r, c: 0.02 * (r - 11.5))
    return "".join(",".join(f"{cell(r, c):.3f}" for c in range(32)) + "\n" for r in range(24))


def ball():
    """A ball of 20 px radius lit from the camera, 48 by 48."""
    def level(r, c):
        share = ((r - 23.5) ** 2 + (c - 23.5) ** 2) / 400
        return round(255 * (1 - share) ** 0.5) if share < 1 else 0
    return "P2\n48 48\n255\n" + "".join(" ".join(str(level(r, c)) for c in range(48)) + "\n" for r in range(48))


# A sensor that grows darker where it is pressed: 60 grey levels for each millimetre. A ball of 4 mm radius, 0.6 mm deep,
# on pixels of 100 µm.
PIXEL_MM, BALL_MM, DEPTH_MM, LEVELS_PER_MM = 0.1, 4.0, 0.6, 60.0


def dark(pressed):
    def level(r, c):
        noise = 2 * error(97 * r + 31 * c + (5000 if pressed else 0), 0.618034)
        distance = PIXEL_MM * ((r - 31.5) ** 2 + (c - 39.5) ** 2) ** 0.5
        depth = DEPTH_MM - BALL_MM + max(BALL_MM**2 - distance**2, 0.0) ** 0.5
        return round(150 + noise - (LEVELS_PER_MM * max(depth, 0.0) if pressed else 0.0))
    return "P2\n80 64\n255\n" + "".join(" ".join(str(level(r, c)) for c in range(80)) + "\n" for r in range(64))


def depth_table():
    return "darkness_grey_levels,depth_mm\n" + "".join(f"{6 * k},{6 * k / LEVELS_PER_MM:.2f}\n" for k in range(11))


# A press on a sensor that grows brighter in proportion to the pressure: a ball of 3 mm radius and 103 kPa on a deep guide of
# 100 kPa, both incompressible, at two loads within Hertz's range (a/R 0.23 and 0.29). Pixels of 40 um, 130 rows, 174 columns.
PIXEL_M, RADIUS_M, GREY_PER_PA = 40e-6, 3e-3, 0.012
REDUCED_PA = 1 / (0.75 / 103e3 + 0.75 / 100e3)
LOADS_N = [0.01, 0.02]
GRAVITY, WEIGHT_KG = 9.81, 2e-3


def png(rows):
    """A grey image of 8 bits without compression, so that the bytes do not depend on a compressor."""
    def chunk(tag, data):
        return struct.pack(">I", len(data)) + tag + data + struct.pack(">I", zlib.crc32(tag + data))
    size = struct.pack(">IIBBBBB", len(rows[0]), len(rows), 8, 0, 0, 0, 0)
    data = zlib.compress(b"".join(b"\0" + bytes(row) for row in rows), 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", size) + chunk(b"IDAT", data) + chunk(b"IEND", b"")


def frame(force, seed):
    """Hertz's pressure p0 sqrt(1 - r^2/a^2) in grey levels above 10, and the noise of the camera."""
    a = (3 * force * RADIUS_M / (4 * REDUCED_PA)) ** (1 / 3)
    peak = GREY_PER_PA * 3 * force / (2 * math.pi * a * a) if force else 0.0

    def level(r, c):
        share = PIXEL_M**2 * ((r - 64.5) ** 2 + (c - 86.5) ** 2) / (a * a) if force else 1.0
        noise = 2 * error(174 * r + c + seed, 0.7548776662)
        return round(10 + noise + peak * math.sqrt(max(1 - share, 0.0)))
    return png([[level(r, c) for c in range(174)] for r in range(130)])


def calibration():
    rows = ["integrated_pixel_value,force_N"]
    for k in list(range(9)) + list(range(7, -1, -1)):
        force = 0.004 * k
        value = GREY_PER_PA * force / PIXEL_M**2
        rows.append(f"{value:.0f},{force + 2e-5 * error(len(rows), 0.618034):.6f}")
    return "\n".join(rows) + "\n"


def scene(check=True):
    frames = "".join(f'[[frames]]\nimage = "frame_{k + 1}.png"\n\n' for k in range(len(LOADS_N)))
    weight = f"""[[check]] # the same ball under a weight of {1e3 * WEIGHT_KG:g} g
image = "weight.png"
force_N = {GRAVITY * WEIGHT_KG:.5f}
object = "sample"

"""
    return f"""# A ball on a soft sensor, frames at {LOADS_N[0]} and {LOADS_N[1]} N; the ball has 103 kPa.
reference = "reference.png"
pixel_size_m = [{PIXEL_M}, {PIXEL_M}]

[calibration]
pairs = "calibration.csv"
reference = "reference.png"

{frames}{weight if check else ""}[object]
shape = "sphere"
radius_m = {RADIUS_M}
poisson_ratio = 0.5
adhesion_error_j_per_m2 = 0.0002 # powdered with talc

[waveguide]
layers = [{{ refractive_index = 1.40, thickness_m = 10e-3, youngs_modulus_pa = 100e3, poisson_ratio = 0.5 }}]
"""


def skin_scene():
    """The same press as under a fixed diffusing skin: the object's reflectance does not matter."""
    return scene(check=False).replace("\n[calibration]", 'coupling_error = "exact"\n\n[calibration]')


# Calibration of the same kind of sensor: two rigid balls on one guide of 100 kPa, up and down again, in frames of 72 by 72 pixels.
# (radius in metres, forces in newtons with the number of those while loading)
BALLS = [(3e-3, [0.003, 0.006, 0.012, 0.02, 0.012, 0.006], 4), (6e-3, [0.005, 0.01, 0.02, 0.01], 3)]
SMALL = 72
# Contact radii by `tactile_fem` on a guide of 100 kPa and 10 mm (Poisson's ratio 0.4999, no friction).
CONTACT_M = {(3e-3, 0.003): 0.37154e-3, (3e-3, 0.006): 0.46833e-3, (3e-3, 0.012): 0.58967e-3, (3e-3, 0.02): 0.69905e-3,
             (6e-3, 0.005): 0.55437e-3, (6e-3, 0.01): 0.69881e-3, (6e-3, 0.02): 0.88161e-3}


def sensor_frame(ball_m, force, seed):
    """Hertz's pressure of a rigid ball over its contact on the guide."""
    a = CONTACT_M[ball_m, force] if force else 1.0
    peak = GREY_PER_PA * 3 * force / (2 * math.pi * a * a)

    def level(r, c):
        share = PIXEL_M**2 * ((r - 35.2) ** 2 + (c - 35.8) ** 2) / (a * a)
        noise = 2 * error(SMALL * r + c + seed, 0.7548776662)
        return round(10 + noise + peak * math.sqrt(max(1 - share, 0.0)))
    return png([[level(r, c) for c in range(SMALL)] for r in range(SMALL)])


# A flat tip of 1 mm radius under weights of 0.4 to 1.2 g. Its pressure is singular at the edge, so that pixels have the mean
# pressure.
TIP_M, WEIGHTS_KG = 1e-3, [0.4e-3, 0.6e-3, 0.8e-3, 1.0e-3, 1.2e-3]


def tip_frame(force, seed):
    """Pressure of a rigid flat tip on a deep guide, F/(2 pi a sqrt(a^2 - r^2)), as the mean over 5 by 5 positions in a pixel."""
    def pressure(r, c):
        share = PIXEL_M**2 * ((r - 35.2) ** 2 + (c - 35.8) ** 2) / TIP_M**2
        return force / (2 * math.pi * TIP_M**2 * math.sqrt(1 - share)) if share < 1 else 0.0

    def level(r, c):
        mean = sum(pressure(r + (i - 2) / 5, c + (j - 2) / 5) for i in range(5) for j in range(5)) / 25
        return min(255, round(10 + 2 * error(SMALL * r + c + seed, 0.7548776662) + GREY_PER_PA * mean))
    return png([[level(r, c) for c in range(SMALL)] for r in range(SMALL)])


def weights_calibration():
    presses = "".join(f"""
[[presses]]
image = "weight_{k + 1}.png"
force_N = {9.81 * mass + 1e-5 * error(k, 0.618034):.6f}
branch = "loading"
indenter = {{ shape = "punch", radius_m = {TIP_M} }}
""" for k, mass in enumerate(WEIGHTS_KG))
    head, _, tail = sensor_calibration().partition("\n[[presses]]")
    head = head.replace("Two steel balls on a soft sensor of one layer: the layer has 100 kPa, but 95 kPa are stated.",
                        "A flat tip of 1 mm radius under weights of 0.4 to 1.2 g, on the sensor of calibration.toml.")
    head = head.replace("gauge_noise_N = 2e-5\ncovers_N = [0.003, 0.02]", "gauge_noise_N = 1e-5")
    return head + presses + "\n" + tail[tail.index("[[layers]]"):]


def sensor_presses():
    """Ball, force, branch and number of every press."""
    rows = [(ball, force, "loading" if k < rising else "unloading") for ball, forces, rising in BALLS for k, force in enumerate(forces)]
    return [(k + 1, *row) for k, row in enumerate(rows)]


def sensor_calibration():
    presses = "".join(f"""
[[presses]]
image = "press_{k:02}.png"
force_N = {force + 2e-5 * error(k, 0.618034):.6f}
branch = "{branch}"
indenter = {{ shape = "ball", radius_m = {ball}, radius_error_m = 1e-6 }}
""" for k, ball, force, branch in sensor_presses())
    return f"""# Two steel balls on a soft sensor of one layer: the layer has 100 kPa, but 95 kPa are stated.
date = "2026-11-22"
temperature_c = 22.5
references = ["reference.png"]
pixel_size_m = [{PIXEL_M}, {PIXEL_M}]
pixel_size_error = 1e-3
flat_field = false
gauge_error = 1e-3
gauge_noise_N = 2e-5
covers_N = [0.003, 0.02]
{presses}
[[layers]]
refractive_index = 1.40
thickness_m = 10e-3
thickness_error_m = 0.1e-3
youngs_modulus_pa = 95e3
youngs_modulus_error_pa = 10e3
poisson_ratio = 0.5
poisson_ratio_error = 0.0
"""


# A block of tissue (5 kPa, 30 mm high, 40 mm in radius) with a lump (12 mm, its top 4 mm deep, 40 kPa) under a face of 16 mm, at three
# approaches: pressure every 0.25 mm from the axis, by finite elements at finite strain (nu 0.495), and the force.
LUMP_PIXEL_M, LUMP_GREY_PER_PA = 0.4e-3, 0.1
LUMP_PRESSES = [
    (1e-3, 0.38091, [
        584.4, 583.8, 581.6, 578.0, 573.1, 567.0, 559.7, 551.5, 542.4, 532.6, 522.0, 510.9, 499.4, 487.6, 475.7, 463.7, 451.9,
        440.2, 428.8, 417.7, 407.2, 397.1, 387.6, 378.7, 370.3, 362.6, 355.6, 349.3, 343.5, 338.3, 333.8, 330.0, 326.7, 323.9,
        321.7, 320.0, 318.8, 318.1, 317.9, 318.1, 318.8, 319.9, 321.6, 323.7, 326.4, 329.7, 333.3, 337.6, 342.7, 348.7, 355.8,
        363.1, 371.8, 382.4, 395.3, 410.1, 426.9, 448.8, 477.2, 510.1, 554.8, 520.7, 418.4, 1085.4, 2495.2]),
    (2e-3, 0.77562, [
        1191.3, 1190.1, 1185.7, 1178.4, 1168.3, 1155.8, 1141.1, 1124.3, 1105.7, 1085.5, 1063.9, 1041.2, 1017.5, 993.2, 968.5,
        943.8, 919.4, 895.2, 871.6, 848.6, 826.6, 805.7, 785.9, 767.2, 749.7, 733.7, 719.0, 705.6, 693.5, 682.6, 673.1, 664.9,
        657.8, 651.9, 647.2, 643.4, 640.7, 639.0, 638.3, 638.6, 639.7, 641.6, 644.6, 648.6, 653.8, 660.1, 666.9, 675.1, 684.8,
        696.4, 709.9, 724.4, 740.9, 761.1, 785.7, 814.9, 846.3, 887.4, 941.0, 1009.0, 1095.2, 1191.7, 686.4, 1614.8, 5119.8]),
    (3e-3, 1.18636, [
        1824.6, 1822.8, 1816.1, 1804.9, 1789.5, 1770.4, 1747.7, 1722.0, 1693.4, 1662.3, 1629.1, 1594.0, 1557.4, 1519.9,
        1481.6, 1443.2, 1405.3, 1367.7, 1330.9, 1295.0, 1260.5, 1227.9, 1196.9, 1167.6, 1140.1, 1114.7, 1091.6, 1070.5,
        1051.3, 1034.1, 1019.1, 1005.9, 994.7, 985.2, 977.5, 971.3, 966.7, 963.6, 962.1, 962.1, 963.5, 965.9, 969.9, 975.5,
        982.7, 991.7, 1001.6, 1013.2, 1027.1, 1043.6, 1063.0, 1084.2, 1107.7, 1136.5, 1171.5, 1214.1, 1258.3, 1315.7, 1391.1,
        1496.0, 1630.1, 1774.3, 859.1, 1621.7, 6434.8]),
]


def lump_frame(pressures, seed):
    """The pressure in grey levels above 10, and the noise of the camera."""
    def level(r, c):
        at = LUMP_PIXEL_M * math.hypot(r - 47.3, c - 47.8) / 0.25e-3
        k = min(int(at), len(pressures) - 2) if pressures else 0
        inside = pressures and at < len(pressures) - 1
        pressure = pressures[k] + (at - k) * (pressures[k + 1] - pressures[k]) if inside else 0.0
        # The rim of the face, where the pressure is singular, is overexposed.
        return min(255, round(10 + 2 * error(96 * r + c + seed, 0.7548776662) + LUMP_GREY_PER_PA * pressure))
    return png([[level(r, c) for c in range(96)] for r in range(96)])


def lump_calibration():
    rows = ["integrated_pixel_value,force_N"]
    rows += [f"{LUMP_GREY_PER_PA * force / LUMP_PIXEL_M**2:.0f},{force:.6f}" for force in (0.1 * k for k in range(15))]
    return "\n".join(rows) + "\n"


def lump_scene():
    frames = "".join(f"""
[[frames]]
image = "frame_{k + 1}.png"
approach_m = {approach}
force_N = {force}
""" for k, (approach, force, _) in enumerate(LUMP_PRESSES))
    return f"""# A block of tissue with a lump, pressed by the sensor's flat guide to three approaches.
reference = "reference.png"
pixel_size_m = [{LUMP_PIXEL_M}, {LUMP_PIXEL_M}]

[calibration]
pairs = "calibration.csv"
{frames}
[object]
shape = "block"
height_m = 30e-3
radius_m = 40e-3
interface = "bonded"

[waveguide]                            # from the block's side to the glass
radius_m = 16e-3
layers = [
    {{ thickness_m = 2e-3, youngs_modulus_pa = 136e3, poisson_ratio = 0.495 }},
    {{ thickness_m = 3e-3, youngs_modulus_pa = 80e3, poisson_ratio = 0.495 }},
    {{ thickness_m = 5e-3, youngs_modulus_pa = 34e3, poisson_ratio = 0.495 }},
]
"""


# The same block, 60 mm in radius, without the lump and with it, at two approaches: pressure every 0.25 mm from the axis. Three
# presses, each some tenths of a millimetre off its stated position, around the centre of the lump at (8, 4) mm.
SCAN_APPROACHES = [1.5e-3, 3e-3]
SCAN_PLAIN = [[
    461.4, 461.4, 461.5, 461.6, 461.8, 462.0, 462.2, 462.5, 462.9, 463.3, 463.7, 464.2, 464.7, 465.3, 466.0, 466.6,
    467.4, 468.2, 469.0, 469.9, 470.9, 472.0, 473.1, 474.2, 475.5, 476.8, 478.2, 479.7, 481.3, 483.1, 484.9, 486.8,
    488.9, 491.2, 493.6, 496.2, 499.0, 502.0, 505.3, 508.9, 512.8, 517.1, 521.8, 527.0, 532.7, 539.0, 546.1, 554.0,
    562.8, 572.7, 584.0, 597.2, 611.6, 628.5, 648.9, 672.6, 699.5, 734.5, 779.0, 833.6, 911.3, 1021.7, 1150.8, 813.7,
], [
    932.6, 932.6, 932.8, 933.0, 933.3, 933.7, 934.1, 934.7, 935.3, 936.0, 936.8, 937.7, 938.7, 939.8, 941.0, 942.3,
    943.6, 945.1, 946.7, 948.4, 950.2, 952.1, 954.1, 956.3, 958.6, 961.1, 963.7, 966.5, 969.4, 972.6, 976.0, 979.6,
    983.5, 987.7, 992.2, 997.0, 1002.3, 1007.9, 1014.1, 1020.8, 1028.2, 1036.1, 1044.9, 1054.7, 1065.5, 1077.2,
    1090.5, 1105.4, 1122.0, 1140.4, 1161.6, 1186.2, 1213.6, 1244.9, 1282.7, 1328.1, 1377.2, 1440.6, 1523.3, 1620.5,
    1757.6, 1981.2, 2250.0, 699.1,
]]
SCAN_LUMP = [[
    909.8, 908.7, 905.5, 900.2, 892.9, 883.8, 873.1, 860.8, 847.1, 832.1, 816.1, 799.3, 781.9, 764.1, 746.0, 728.0,
    710.0, 692.3, 675.2, 658.5, 642.5, 627.3, 612.9, 599.5, 586.9, 575.4, 564.8, 555.2, 546.6, 538.9, 532.2, 526.4,
    521.6, 517.6, 514.4, 512.1, 510.5, 509.7, 509.6, 510.3, 511.7, 513.9, 516.7, 520.4, 524.9, 530.2, 536.4, 543.6,
    552.1, 561.5, 572.5, 585.4, 600.3, 616.9, 637.1, 661.6, 689.0, 723.5, 768.9, 822.6, 899.2, 1006.4, 1163.3, 822.4,
], [
    1873.9, 1871.8, 1865.1, 1854.2, 1839.2, 1820.4, 1798.2, 1772.7, 1744.2, 1713.0, 1679.7, 1644.6, 1608.2, 1570.8,
    1532.8, 1494.7, 1456.8, 1419.3, 1382.9, 1347.5, 1313.4, 1280.9, 1250.1, 1221.2, 1194.2, 1169.4, 1146.5, 1125.7,
    1107.0, 1090.4, 1075.7, 1063.0, 1052.2, 1043.2, 1036.0, 1030.4, 1026.5, 1024.1, 1023.3, 1023.9, 1026.1, 1029.7,
    1034.8, 1041.3, 1049.5, 1059.4, 1070.9, 1084.4, 1100.1, 1118.1, 1138.5, 1162.6, 1190.8, 1222.0, 1259.2, 1304.5,
    1356.7, 1419.2, 1501.1, 1599.4, 1731.8, 1944.4, 2245.3, 858.2,
]]
SCAN_LUMP_MM = (8.0, 4.0)
SCAN_PRESSES = [((0, 0), (0.12, -0.2)), ((16, 0), (-0.15, 0.1)), ((8, 14), (0.05, 0.22))]  # said, and off by


def scan_frame(press, load):
    """The pressure of a press with the lump at its position, in grey levels above 10 with the noise of the camera."""
    said, off = SCAN_PRESSES[press]

    def read(values, mm):
        k = min(int(mm / 0.25), len(values) - 2)
        return values[k] + (mm / 0.25 - k) * (values[k + 1] - values[k])

    def level(r, c):
        x, y = 0.4 * (c - 47.8), 0.4 * (r - 47.3)
        radius = math.hypot(x, y)
        pressure = 0.0
        if radius < 15.75:
            lump = min(math.hypot(said[0] + off[0] + x - SCAN_LUMP_MM[0], said[1] + off[1] + y - SCAN_LUMP_MM[1]), 12.0)
            pressure = read(SCAN_PLAIN[load], radius) * read(SCAN_LUMP[load], lump) / read(SCAN_PLAIN[load], lump)
        noise = 2 * error(96 * r + c + 40_000 * (2 * press + load + 7), 0.7548776662)
        return min(255, round(10 + noise + LUMP_GREY_PER_PA * pressure))
    return png([[level(r, c) for c in range(96)] for r in range(96)])


def scan_scene():
    presses = "".join(f"""
[[presses]]
position_m = [{said[0] * 1e-3}, {said[1] * 1e-3}]
frames = [
    {{ image = "scan_{press + 1}_1.png", approach_m = {SCAN_APPROACHES[0]} }},
    {{ image = "scan_{press + 1}_2.png", approach_m = {SCAN_APPROACHES[1]} }},
]
""" for press, (said, _) in enumerate(SCAN_PRESSES))
    head, _, tail = lump_scene().partition("[[frames]]")
    block = tail[tail.index("[object]"):].replace("radius_m = 40e-3", "radius_m = 60e-3")
    head = head.replace("three approaches", "two approaches at each of three places").replace("\n[calibration]", "position_error_m = 0.2e-3\n\n[calibration]")
    return head.rstrip() + "\n" + presses + "\n" + block


FILES = {
    **{f"inclusion/scan_{press + 1}_{load + 1}.png": lambda press=press, load=load: scan_frame(press, load)
       for press in range(len(SCAN_PRESSES)) for load in range(2)},
    "inclusion/scan.toml": scan_scene,
    "inclusion/reference.png": lambda: lump_frame([], 0),
    **{f"inclusion/frame_{k + 1}.png": lambda k=k, p=pressures: lump_frame(p, 40_000 * (k + 1)) for k, (_, _, pressures) in enumerate(LUMP_PRESSES)},
    "inclusion/calibration.csv": lump_calibration,
    "inclusion/scene.toml": lump_scene,
    "sensor/reference.png": lambda: sensor_frame(3e-3, 0.0, 0),
    **{f"sensor/press_{k:02}.png": lambda k=k, ball=ball, force=force: sensor_frame(ball, force, 40_000 * k)
       for k, ball, force, _ in sensor_presses()},
    "sensor/calibration.toml": sensor_calibration,
    **{f"sensor/weight_{k + 1}.png": lambda k=k, mass=mass: tip_frame(9.81 * mass, 40_000 * (k + 30)) for k, mass in enumerate(WEIGHTS_KG)},
    "sensor/weights.toml": weights_calibration,
    "press/reference.png": lambda: frame(0.0, 0),
    "press/frame_1.png": lambda: frame(LOADS_N[0], 40_000),
    "press/frame_2.png": lambda: frame(LOADS_N[1], 80_000),
    "press/weight.png": lambda: frame(GRAVITY * WEIGHT_KG, 180_000),
    "press/calibration.csv": calibration,
    "press/scene.toml": scene,
    "press/skin.toml": skin_scene,
    "before.csv": lambda: points((k, place(k)) for k in range(120)),
    # The points are in another order, and every 17th is missing.
    "after.csv": lambda: points((j, moved(j)) for j in (37 * k % 120 for k in range(120)) if j % 17),
    # The points row by row, for a warp.
    "sources.csv": lambda: points((k, place(k)) for k in range(40)),
    "targets.csv": lambda: points((k, moved(k)) for k in range(40)),
    "queries.csv": lambda: points((k, (1.0 + 2 * (k % 5), 1.0 + 2 * (k // 5))) for k in range(25)),
    "cases.txt": cases,
    "slope_x.csv": lambda: slopes(True),
    "slope_y.csv": lambda: slopes(False),
    "ball.pgm": ball,
    "dark_reference.pgm": lambda: dark(False),
    "dark_frame.pgm": lambda: dark(True),
    "depth_table.csv": depth_table,
}

if __name__ == "__main__":
    differing = []
    for name, make in FILES.items():
        path, content = FOLDER / name, make()
        content = content if isinstance(content, bytes) else content.encode()
        if "--check" not in sys.argv:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
        elif not path.exists() or path.read_bytes() != content:
            differing.append(name)
    if differing:
        sys.exit(f"differ from what evidence/example_data.py writes: {', '.join(differing)}")
