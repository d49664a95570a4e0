"""Measures every scene of a folder with Dask, into a folder of Parquet files.

    python dataset_dask.py SCENES RESULTS                            # two processes of this machine
    python dataset_dask.py SCENES RESULTS --scheduler tcp://host:8786  # a cluster that sees SCENES

Every `scene.toml` below SCENES is one row. Scenes with results in RESULTS are not measured again, so that a stopped run continues.
If a worker is killed, another one measures its scene.
`pyarrow.parquet.read_table(RESULTS)` reads the whole.
"""

import argparse
import os
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
from dask.distributed import Client, LocalCluster, as_completed

SCHEMA = pa.schema(
    [
        ("scene", pa.string()),
        ("youngs_modulus_pa", pa.float64()),
        ("standard_error_pa", pa.float64()),
        ("lower_95_pa", pa.float64()),
        ("upper_95_pa", pa.float64()),
        ("estimator", pa.string()),
        ("flags", pa.list_(pa.string())),
        ("error", pa.string()),
    ]
)


def measure(folder, scene):
    """One row. A scene that cannot be measured has the reason instead of a modulus."""
    import tactile_imaging as ti

    try:
        modulus = ti.Press.from_scene(Path(folder) / scene).modulus()
    except (OSError, ValueError, ti.TactileError) as error:
        return {"scene": scene, "error": str(error)}
    lower, upper = modulus.interval_95
    return {
        "scene": scene,
        "youngs_modulus_pa": modulus.value,
        "standard_error_pa": modulus.standard_error,
        "lower_95_pa": lower,
        "upper_95_pa": upper,
        "estimator": modulus.estimator,
        "flags": modulus.flags,
    }


def left(folder, results):
    """Scenes that have no row yet, in order."""
    scenes = {str(path.relative_to(folder)) for path in Path(folder).rglob("scene.toml")}
    parts = Path(results).glob("*.parquet")
    done = {row for part in parts for row in pq.read_table(part)["scene"].to_pylist()}
    return sorted(scenes - done)


def write(rows, results):
    """A file of rows, which is there as a whole or not at all."""
    results = Path(results)
    results.mkdir(parents=True, exist_ok=True)
    part = results / f"part-{len(list(results.glob('*.parquet'))):06}.parquet"
    draft = part.with_suffix(".draft")
    pq.write_table(pa.Table.from_pylist(rows, SCHEMA), draft)
    os.replace(draft, part)


def measure_all(folder, scenes):
    return [measure(folder, scene) for scene in scenes]


def run(client, folder, results, rows_per_file=100, scenes_per_task=20):
    """Measures what is left and writes it as it comes in.

    A scene may take ten milliseconds and a task costs the scheduler a few, hence some scenes a task.
    """
    folder = Path(folder).resolve()
    scenes = left(folder, results)
    tasks = [scenes[k : k + scenes_per_task] for k in range(0, len(scenes), scenes_per_task)]
    futures = client.map(measure_all, [str(folder)] * len(tasks), tasks, pure=False)
    rows = []
    try:
        for _, found in as_completed(futures, with_results=True):
            rows += found
            if len(rows) >= rows_per_file:
                write(rows, results)
                rows = []
    finally:
        # Finished results are kept if the run ends early.
        if rows:
            write(rows, results)
    return len(scenes)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", help="folder with scene.toml files at any depth")
    parser.add_argument("results", help="folder for Parquet files")
    parser.add_argument("--scheduler", help="address of a Dask scheduler")
    parser.add_argument("--workers", type=int, default=2, help="processes, without a scheduler")
    given = parser.parse_args()
    if given.scheduler:
        with Client(given.scheduler) as client:
            count = run(client, given.scenes, given.results)
    else:
        # One thread each, so that a killed process loses only one task.
        local = LocalCluster(n_workers=given.workers, threads_per_worker=1, dashboard_address=None)
        with local as cluster, Client(cluster) as client:
            count = run(client, given.scenes, given.results)
    print(f"{count} scenes measured")


if __name__ == "__main__":
    main()
