"""The example that measures a folder of scenes with Dask."""

import os
import shutil
import signal
import sys

import pyarrow.parquet as pq
import pytest
from conftest import DATA
from dask.distributed import Client, LocalCluster

sys.path.insert(0, str(DATA.parent / "python"))
import dataset_dask as dataset  # noqa: E402


@pytest.fixture
def folder(tmp_path):
    """Twelve scenes, one of them broken."""
    for k in range(12):
        shutil.copytree(DATA / "press", tmp_path / "scenes" / f"{k:02}")
    (tmp_path / "scenes" / "03" / "frame_1.png").unlink()
    return tmp_path / "scenes"


def table(results):
    return sorted(pq.read_table(results).to_pylist(), key=lambda row: row["scene"])


def test_a_killed_worker_loses_nothing_and_a_second_run_goes_on(folder, tmp_path, monkeypatch):
    scenes = dataset.left(folder, tmp_path / "none")
    dataset.write([dataset.measure(folder, scene) for scene in scenes], tmp_path / "serial")
    serial = table(tmp_path / "serial")
    results = tmp_path / "results"
    # Five scenes were measured by a run that was stopped.
    dataset.write([dataset.measure(folder, scene) for scene in scenes[:5]], results)
    local = LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None)
    with local as cluster, Client(cluster) as client:
        workers = list(client.run(os.getpid).values())
        write = dataset.write

        def kill_and_write(rows, results):
            while workers:
                os.kill(workers.pop(), signal.SIGKILL)
            write(rows, results)

        monkeypatch.setattr(dataset, "write", kill_and_write)
        assert dataset.run(client, folder, results, rows_per_file=2, scenes_per_task=1) == 7
        assert not workers
        assert dataset.run(client, folder, results) == 0
    assert table(results) == serial
    assert [row["scene"] for row in serial if row["error"]] == ["03/scene.toml"]
