#!/usr/bin/env python3
"""Renders a job of `groundel plan` on the workers of a Dask cluster, and assembles it.

    dask_render.py JOB [--out OUT.tif] [--scheduler tcp://HOST:PORT | --workers N | --slurm N]

Every task is the same idempotent command, `groundel render JOB --batch K`; what Dask does is to hand batches to workers and to
give the batch of a lost worker to another one. A worker runs a batch for each of its threads, within its memory limit, which
is handed on as --memory; the command ends by itself when its worker dies. A batch that fails is tried again, elsewhere if it can
be; bad input (exit code 2) and jobs over budget (3) are not, since they would fail again.

The folder of the job and the photographs must be at the same place on every worker. Exit codes: that of the batch that
could not be made, of `groundel assemble`, or 0.

Needs dask.distributed; --slurm needs dask-jobqueue."""
import argparse
import os
import subprocess
import sys
import time

from distributed import Client, KilledWorker, LocalCluster, as_completed, get_worker

# What the Python process of a worker takes beside the command, bytes.
BESIDE = 192 << 20
LEAST_MEMORY = 256 << 20
# Exit codes after which a second try may help: 4, and a death by a signal.
FINAL = {2: "bad input", 3: "over budget"}


class Failed(Exception):
    """A batch that could not be rendered."""

    def __init__(self, batch, code, said):
        super().__init__(batch, code, said)
        self.batch, self.code, self.said = batch, code, said


def render(groundel, job, batch, memory, threads):
    """Runs on a worker: one batch, by a process that ends when the worker does."""
    worker = get_worker()
    limit = worker.memory_manager.memory_limit
    if memory is None and limit:
        # A worker of several threads runs as many batches.
        memory = max((limit - BESIDE) // worker.state.nthreads, LEAST_MEMORY)
    command = [groundel, "render", job, "--batch", str(batch), "--threads", str(threads), "--quiet"]
    command += ["--parent", str(os.getpid())] + (["--memory", str(memory)] if memory else [])
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True)
    if done.returncode != 0:
        said = done.stderr.strip().splitlines() or [f"ended by signal {-done.returncode}"]
        # Not raised: Dask would not tell apart what may be tried again.
        return batch, done.returncode, said[-1]
    return batch, 0, ""


def cluster_of(args):
    """The cluster to render on: one that runs, one on this machine, or jobs of Slurm."""
    if args.scheduler:
        return args.scheduler
    memory = args.memory + BESIDE if args.memory else None
    if args.slurm:
        from dask_jobqueue import SLURMCluster

        if not memory:
            sys.exit("--slurm needs --memory: it is what the jobs ask Slurm for")
        cluster = SLURMCluster(cores=args.threads, processes=1, memory=f"{memory}B", n_workers=args.slurm)
    else:
        cluster = LocalCluster(
            n_workers=args.workers, threads_per_worker=1, dashboard_address=args.dashboard, memory_limit=memory or "auto"
        )
    return cluster


def render_all(client, args, batches):
    """Renders the batches; each is tried --tries times."""
    tries = dict.fromkeys(batches, 1)

    def submit(batch):
        key = f"batch-{batch}-try-{tries[batch]}"
        return client.submit(render, args.groundel, args.job, batch, args.memory, args.threads, key=key, pure=False)

    queue = as_completed([submit(batch) for batch in batches])
    started, done = time.monotonic(), 0
    for future in queue:
        batch = int(future.key.split("-")[1])
        try:
            _, code, said = future.result()
        except KilledWorker:
            code, said = 4, "several workers died while they rendered it"
        # A finished result is not kept: should its worker die, Dask would make it again.
        future.release()
        if code == 0:
            done += 1
            rate = done / (time.monotonic() - started)
            print(f"{done} of {len(batches)} batches, {(len(batches) - done) / rate:.0f} s left", flush=True)
        elif code in FINAL or tries[batch] >= args.tries:
            queue.clear()
            raise Failed(batch, code, said)
        else:
            tries[batch] += 1
            print(f"batch {batch}: {said}; try {tries[batch]} of {args.tries}", flush=True)
            queue.add(submit(batch))


def memory_size(text):
    """Bytes of 512MiB, 2GiB or a plain number."""
    for unit, factor in (("MiB", 1 << 20), ("GiB", 1 << 30), ("", 1)):
        if text.endswith(unit):
            return int(float(text.removesuffix(unit)) * factor)
    raise ValueError(text)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("job", help="folder that groundel plan made")
    parser.add_argument("--out", help="assemble the mosaic here in the end")
    parser.add_argument("--remove", action="store_true", help="remove the job's parts once the mosaic is there")
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--scheduler", help="address of a running Dask scheduler")
    where.add_argument("--workers", type=int, default=2, help="workers on this machine (2)")
    where.add_argument("--slurm", type=int, help="workers as jobs of Slurm")
    parser.add_argument("--memory", type=memory_size, help="memory of a batch, as 1GiB (the worker's limit, less 192 MiB)")
    parser.add_argument("--threads", type=int, default=1, help="threads of a batch (1)")
    parser.add_argument("--tries", type=int, default=3, help="times that a batch is tried (3)")
    parser.add_argument("--dashboard", default="127.0.0.1:0", help="address of a local cluster's dashboard")
    parser.add_argument("--groundel", default="groundel", help="the command, if it is not in the PATH")
    args = parser.parse_args()
    args.job = os.path.abspath(args.job)
    missing = subprocess.run([args.groundel, "render", args.job, "--missing"], stdout=subprocess.PIPE, text=True)
    if missing.returncode != 0:
        return missing.returncode
    batches = [int(line) for line in missing.stdout.split()]
    if batches:
        with Client(cluster_of(args), timeout=60) as client:
            print(f"{len(batches)} batches, dashboard {client.dashboard_link}", flush=True)
            try:
                render_all(client, args, batches)
            except Failed as failed:
                kind = FINAL.get(failed.code, f"tried {args.tries} times")
                print(f"batch {failed.batch} cannot be rendered ({kind}): {failed.said}", file=sys.stderr)
                return failed.code if failed.code > 0 else 4
            finally:
                if client.cluster is not None:
                    client.cluster.close()
    if args.out:
        command = [args.groundel, "assemble", args.job, "--out", args.out] + ["--remove"] * args.remove
        return subprocess.run(command).returncode
    return 0


if __name__ == "__main__":
    sys.exit(main())
