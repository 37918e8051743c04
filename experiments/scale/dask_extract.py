"""A study in shards on workers of Dask becomes the same file as on one machine, although a worker is killed in the middle.

    pip install ./python 'dask[distributed]'
    python experiments/scale/dask_extract.py                                             # two workers here, one is killed
    python experiments/scale/dask_extract.py --scheduler tcp://HOST:8786 --folder DIR    # workers of yours, none is killed

Without --scheduler, the script starts two worker processes. When the first shard is done, it kills a worker that runs another, with
kill -9, and Dask gives the shard to a worker that lives. In the end the merged shards must have the bytes of `vernis extract` without
--shard, which has a cache of its own; with --scheduler, only if --compare asks for it. A task is one shard, and runs the program that
comes with the Python package, `python -m vernis`.

All workers must see --folder, and the data, under the same path. `--study lavoue2021-open` finds its data where the variable
VERNIS_DATA says, on the workers as well; the default, synthetic, is embedded in the program and needs none. Two workers on one machine
show that the result is right, not how fast it is.
"""

import argparse
import contextlib
import filecmp
import hashlib
import logging
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import psutil
from distributed import Client, LocalCluster, as_completed


def vernis(*arguments):
    """Runs the program of the Python package and returns what it prints. What went wrong becomes an exception."""
    command = [sys.executable, "-m", "vernis", *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(f"vernis {arguments[0]} ended with code {done.returncode}: {done.stderr.strip()}")
    return done.stdout.strip()


def extract_shard(shard, study, folder, threads):
    """The task. Returns the process of the worker that ran it."""
    vernis(
        *("extract", "--study", study, "--cache", f"{folder}/cache", "--out", f"{folder}/shards"),
        *("--threads", threads, "--shard", shard),
    )
    return os.getpid()


def running_shards():
    """What runs below this process: shard, process of the worker, process of the program."""
    for program in psutil.Process().children(recursive=True):
        with contextlib.suppress(psutil.NoSuchProcess):
            words = program.cmdline()
            if "--shard" in words:
                yield words[words.index("--shard") + 1], program.ppid(), program.pid


def end_programs():
    """Ends what workers have started and an interrupted script leaves behind."""
    for _, _, program in running_shards():
        with contextlib.suppress(ProcessLookupError):
            os.kill(program, signal.SIGKILL)


def shard_file(folder, shard):
    """Whether the file of a shard is written."""
    number, count = shard.split("/")
    return any((folder / "shards").glob(f"*-{number.zfill(len(count))}-of-{count}.parquet"))


def kill_one(folder):
    """Kills a worker that runs a shard, and the program that it started. Returns the shard and the process of the worker."""
    while True:
        for shard, worker, program in running_shards():
            if shard_file(folder, shard):
                continue
            # The worker first: it must not live to report that its program failed.
            for process in (worker, program):
                with contextlib.suppress(ProcessLookupError):
                    os.kill(process, signal.SIGKILL)
            if shard_file(folder, shard):
                sys.exit(f"shard {shard} was done before the kill: run the script again")
            return shard, worker
        time.sleep(0.05)


def cached(folder):
    """Files of the cache, with the time at which each was written."""
    return {(path.name, path.stat().st_mtime_ns) for path in (folder / "cache").iterdir() if not path.name.startswith(".")}


def run(client, options, folder, say):
    """Extracts all shards. Returns how many files the cache held at the kill, and how many of these were written again."""
    shards = [f"{number}/{options.shards}" for number in range(1, options.shards + 1)]
    client.wait_for_workers(1, timeout=60)
    say(f"{len(client.run(os.getpid))} workers, {len(shards)} shards of {options.study}")
    # A shard whose worker dies is given to another; a shard that fails ends the script, as it would fail again.
    futures = [client.submit(extract_shard, s, options.study, str(folder), options.threads, key=s, pure=False) for s in shards]
    killed = worker = None
    held = set()
    ended = {}
    for future, process in as_completed(futures, with_results=True):
        ended[future.key] = process
        if killed is None and options.scheduler is None:
            killed, worker = kill_one(folder)
            held = cached(folder)
            say(f"worker {worker}, which runs shard {killed}, is killed; {len(ended)} of {len(shards)} shards are done")
    if killed is not None:
        if ended[killed] == worker:
            sys.exit(f"shard {killed} was not run again: the kill hit nothing")
        say(f"all shards are done; worker {ended[killed]} ran shard {killed} again")
    else:
        say("all shards are done")
    return len(held), len(held - cached(folder))


def main():
    """Runs the experiment."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--study", default="synthetic", help="as of `vernis extract`")
    parser.add_argument("--shards", type=int, default=16, help="number of tasks; 16 by default")
    parser.add_argument("--threads", type=int, default=1, help="threads of each task; 1 by default")
    parser.add_argument("--scheduler", help="address of a Dask scheduler of yours")
    parser.add_argument("--folder", type=Path, help="for cache, shards and the merged file; by default a temporary one, which is removed")
    parser.add_argument("--compare", action="store_true", help="with --scheduler: compare with an unsharded run, which this machine does")
    options = parser.parse_args()
    if Path(options.study).is_file():
        options.study = str(Path(options.study).resolve())
    if options.scheduler and not options.folder:
        parser.error("--scheduler needs --folder: a folder that all workers see")
    start = time.monotonic()

    def say(what):
        print(f"{time.monotonic() - start:4.0f} s  {what}", flush=True)

    with contextlib.ExitStack() as stack:
        folder = options.folder or Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="vernis-dask-")))
        folder = folder.resolve()
        if options.scheduler:
            client = stack.enter_context(Client(options.scheduler))
        else:
            # Port 0 is any free one: without an address, Dask takes 8787, and warns where another cluster has it.
            cluster = LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address="127.0.0.1:0", silence_logs=logging.CRITICAL)
            stack.enter_context(cluster)
            stack.callback(end_programs)
            client = stack.enter_context(Client(cluster))
        held, again = run(client, options, folder, say)
        merged = folder / "merged.parquet"
        vernis("merge", *sorted((folder / "shards").glob(f"*-of-{options.shards}.parquet")), "--out", merged, "--replace")
        say(f"merged: {merged}")
        if options.scheduler and not options.compare:
            return
        vernis("extract", "--study", options.study, "--cache", folder / "cache-of-one", "--out", folder / "one")
        say("extracted without shards")
        (one,) = (folder / "one").glob("*.parquet")
        if not filecmp.cmp(merged, one, shallow=False):
            sys.exit("the merged file differs from that of an unsharded run")
        print(f"\nshards {options.shards}, cached files at the kill {held}, of these written again {again}")
        content = merged.read_bytes()
        print(f"merged and unsharded file: equal, {len(content)} bytes, SHA-256 {hashlib.sha256(content).hexdigest()[:16]}")


if __name__ == "__main__":
    main()
