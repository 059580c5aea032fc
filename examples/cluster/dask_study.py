"""Makes a study on a cluster of Dask: python dask_study.py STUDY.toml FOLDER [ADDRESS].

Without an address the workers are two processes of this machine. FOLDER is one that all workers share; the same command goes on where it was interrupted.
"""

from __future__ import annotations

import sys
from pathlib import Path

from distributed import Client

import wetclutch as wc


def main(file: str, folder: str, address: str | None = None) -> None:
    client = Client(address) if address else Client(n_workers=2, threads_per_worker=1, dashboard_address=None)
    with client:
        study = wc.study(file, executor=client, folder=Path(folder) / "parts", progress=True)
    Path(folder, "runs.csv").write_bytes(study.csv)
    print(f"{study.rows.rows} runs: {folder}/runs.csv")


if __name__ == "__main__":
    main(*sys.argv[1:])
