#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
"""One scene from its photographs to its proof, as a job of the Snakefile.

The steps are probe, keygen, claim, train, evaluate, render and verify. What a killed job had done is kept: status.json
says which steps are done and what they took, and is written every few seconds, so that a job that nobody could stop in
order is known too. A training goes on from its checkpoint. A step is done again if its command is another one, and then
all that follow it. result.json, the only file that Snakemake knows of, comes last.

Exit status: 0, also if the message is not detected, which is a result; 1 if a step failed; 2 for wrong words.
"""

import argparse
import fcntl
import json
import os
import resource
import shlex
import shutil
import signal
import socket
import subprocess
import sys
import time

HEARTBEAT = 5  # seconds between two writings of status.json while a step runs
GRACE = 5  # seconds in which the tool may have been told to end by whoever told this job
STATUS, RESULT, LOG = "status.json", "result.json", "scene.log"
VERDICTS = (0, 1, 3)  # of `compmark verify`: detected, not detected, undecided; anything else is an error


def write_json(path, value):
    """Whole or not at all: who reads it meanwhile has the old one."""
    part = f"{path}.{os.getpid()}.part"
    with open(part, "w", encoding="utf-8") as file:
        json.dump(value, file, indent=2)
        file.write("\n")
    os.replace(part, path)


def read_json(path):
    """The object in a file; an empty one where there is none, or half of one."""
    try:
        with open(path, encoding="utf-8") as file:
            value = json.load(file)
        return value if isinstance(value, dict) else {}
    except (OSError, ValueError):
        return {}


def processor_seconds(pid):
    """What a running process and its threads have taken of the processors; 0 where the system does not say."""
    try:
        with open(f"/proc/{pid}/stat", encoding="ascii", errors="replace") as file:
            fields = file.read().rsplit(")", 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    except (OSError, IndexError, ValueError):
        return 0.0


class Failed(Exception):
    """A step that ended without its files; the text says why."""


class Ended(Exception):
    """The job was told to end."""


class Scene:
    def __init__(self, options):
        self.options = options
        self.child = None
        self.told_to_end, self.told_at, self.passed_on = None, 0.0, False
        self.status = {"name": options.name, "steps": {}}

    def file(self, *parts):
        return os.path.join(self.options.out, *parts)

    def save(self, state, **more):
        self.status.update({"state": state, "host": socket.gethostname(), "process": os.getpid(),
                            "threads": self.options.threads, "alive": round(time.time(), 3)}, **more)
        write_json(self.file(STATUS), self.status)

    def on_signal(self, number, _frame):
        self.told_to_end = signal.Signals(number).name
        self.told_at = time.monotonic()

    def pass_on(self):
        """Tells the tool, which then writes a checkpoint. A terminal and Slurm tell all processes, and a second signal
        would end the tool without one: so it is told if it has not ended by itself."""
        if self.told_to_end and not self.passed_on and time.monotonic() - self.told_at >= GRACE:
            self.passed_on = True
            self.child.terminate()

    def step(self, name, words, files, output=None, codes=(0,), before=None):
        """Runs a command of the tool unless it was done before. Its words go into the log, and what it prints."""
        steps = self.status["steps"]
        old = steps.get(name, {})
        if old.get("done") and old.get("words") == words and all(os.path.exists(self.file(f)) for f in files):
            return old["code"]
        for later in list(steps)[list(steps).index(name) + 1:] if name in steps else []:
            steps[later]["done"] = False  # it was done with what this step is about to replace
        if old.get("words") != words:
            old = {}
        spent = {key: old.get(key, 0) for key in ("seconds", "processor_seconds", "sessions", "peak_memory_mb")}
        if self.told_to_end:  # between the last step and this one
            raise Ended(f"the job was told to end ({self.told_to_end}) before this step: {name}")
        steps[name] = step = {"words": words, "done": False, **spent, "sessions": spent["sessions"] + 1}
        self.save("running", step=name, reason=None)
        if before:
            before()
        command = [self.options.compmark, *words]
        # What follows changes no result, and so makes no step run again.
        if name not in ("probe", "keygen", "claim"):
            command += ["--threads", str(self.options.threads)]
        if name == "train":
            command += ["--checkpoint-every", str(self.options.checkpoint_every)]
        began, processors = time.monotonic(), self.children_seconds()
        with open(self.file(LOG), "ab") as log:
            log.write(f"\n$ {shlex.join(command)}\n".encode())
            log.flush()
            place = log.tell()
            part = open(self.file(output + ".part"), "wb") if output else None
            try:
                self.child = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=part or log, stderr=log)
            except OSError as error:
                raise Failed(f"{self.options.compmark} cannot be run: {error.strerror}") from None
            finally:
                if part:
                    part.close()
            while True:
                try:
                    code = self.child.wait(timeout=HEARTBEAT)
                    break
                except subprocess.TimeoutExpired:
                    step["seconds"] = round(spent["seconds"] + time.monotonic() - began, 2)
                    step["processor_seconds"] = round(
                        spent["processor_seconds"] + processor_seconds(self.child.pid), 2)
                    self.save("running")
                    self.pass_on()
            self.child = None
        step["seconds"] = round(spent["seconds"] + time.monotonic() - began, 2)
        step["processor_seconds"] = round(spent["processor_seconds"] + self.children_seconds() - processors, 2)
        largest = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * (1 if sys.platform == "darwin" else 1024)
        step["peak_memory_mb"] = max(spent["peak_memory_mb"], round(largest / 1e6))
        if self.told_to_end:
            raise Ended(f"the job was told to end ({self.told_to_end}) in this step")
        if code not in codes:
            if output:
                os.remove(self.file(output + ".part"))
            raise Failed(self.reason(code, place))
        if output:
            os.replace(self.file(output + ".part"), self.file(output))
        missing = [file for file in files if not os.path.exists(self.file(file))]
        if missing:
            raise Failed(f"the step ended well, and {missing[0]} is not there")
        step.update(done=True, code=code)
        return code

    @staticmethod
    def children_seconds():
        usage = resource.getrusage(resource.RUSAGE_CHILDREN)
        return usage.ru_utime + usage.ru_stime

    def reason(self, code, place):
        """The tool's own line about what is wrong, if it had the time to write one."""
        with open(self.file(LOG), "rb") as log:
            log.seek(place)
            lines = [line for line in log.read().decode(errors="replace").splitlines() if line.strip()]
        told = [line.strip() for line in lines if "error: " in line]
        if code < 0:
            name = signal.Signals(-code).name
            return f"ended by {name}" + (": often too little memory (--config mem_mb=...)" if code == -9 else "")
        return (told or [line.strip() for line in lines] or [f"exit status {code}"])[-1]

    def run(self):
        options, capture, key = self.options, self.options.capture, self.options.key
        claim, model = self.file("owner.claim"), self.file("run", "model.cmk")
        self.step("probe", ["probe", "--data", capture, "--json"], ["probe.json"], output="probe.json")
        if not os.path.exists(key):
            if not options.make_key or self.status["steps"].get("keygen", {}).get("done"):
                self.status["step"] = "keygen"
                raise Failed(f"the key {key} is no longer there; put it back from your copy")
            # Never with --force, and no file that Snakemake would remove: a lost key is a lost mark.
            os.makedirs(os.path.dirname(key), mode=0o700, exist_ok=True)
            self.step("keygen", ["keygen", "--bits", str(options.bits), "--note", options.name, "--out", key], [])
        # The same claim is written again, another one is refused.
        self.step("claim", ["claim", "--key", key, "--out", claim], ["owner.claim"])
        words = ["train", "--data", capture, "--out", self.file("run"), "--codec", options.codec, "--key", key,
                 "--resume"]
        for option in ("seed", "iterations", "downscale"):
            if getattr(options, option) is not None:
                words += ["--" + option, getattr(options, option)]
        self.step("train", words + shlex.split(options.options),
                  ["run/model.cmk", "run/results.json", "run/report.html"])
        # A capture without test views is measured in its training views.
        split = "test" if read_json(self.file("probe.json")).get("views_test") else "train"
        words = ["evaluate", "--model", model, "--data", capture, "--split", split, "--key", key,
                 "--json", self.file("evaluation.json"), "--html", self.file("evaluation.html")]
        if os.path.exists(self.file("run", "unmarked.cmk")):
            words += ["--unmarked", self.file("run", "unmarked.cmk")]
        if options.downscale is not None:
            words += ["--downscale", options.downscale]
        self.step("evaluate", words, ["evaluation.json", "evaluation.html"])
        renders = self.file("renders")
        # Whoever verifies has the images alone, of the file as another process decodes it; those of an older file go.
        self.step("render", ["render", "--model", model, "--split", split, "--out", renders], ["renders"],
                  before=lambda: shutil.rmtree(renders, ignore_errors=True))
        self.step("verify", ["verify", "--images", renders, "--key", key, "--claim", claim,
                             "--json", self.file("proof.json")], ["proof.json"], codes=VERDICTS)
        return self.result(split)

    def result(self, split):
        evaluation, proof = read_json(self.file("evaluation.json")), read_json(self.file("proof.json"))
        steps = self.status["steps"].values()
        pictures = sorted(name for name in os.listdir(self.file("renders")) if name.endswith(".png"))
        return {
            "schema": "compmark.cluster.scene.1",
            "name": self.options.name,
            "split": split,
            "views": len(pictures),
            "psnr": evaluation.get("psnr"),
            "psnr_cost_vs_unmarked": evaluation.get("psnr_cost_vs_unmarked"),
            "bytes": os.path.getsize(self.file("run", "model.cmk")),
            "bits_right": proof.get("matches"),
            "bits": proof.get("bits"),
            "p_value": proof.get("p_value"),
            "verdict": proof.get("verdict"),
            "standing": proof.get("proof", {}).get("standing"),
            "seconds": round(sum(step["seconds"] for step in steps), 1),
            "processor_seconds": round(sum(step["processor_seconds"] for step in steps), 1),
            "sessions": max(step["sessions"] for step in steps),
            "threads": self.options.threads,
            "peak_memory_mb": max(step.get("peak_memory_mb", 0) for step in steps),
            "picture": os.path.join("renders", pictures[0]) if pictures else None,
        }


def options_of(words):
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0], allow_abbrev=False)
    parser.add_argument("--name", required=True)
    parser.add_argument("--capture", required=True, help="folder of photographs and cameras")
    parser.add_argument("--out", required=True, help="the scene's folder")
    parser.add_argument("--key", help="key that is there (default: one of its own in --keys)")
    parser.add_argument("--keys", help="folder of the keys that are made here")
    parser.add_argument("--seed", help="as the options of compmark train")
    parser.add_argument("--iterations", help="… too")
    parser.add_argument("--downscale", help="… too")
    parser.add_argument("--options", default="", help="further options of compmark train, in one word")
    parser.add_argument("--codec", default="hac")
    parser.add_argument("--bits", type=int, default=48, help="length of the message of a new key")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--checkpoint-every", type=int, default=200, help="iterations that a killed job loses at most")
    parser.add_argument("--compmark", default="compmark", help="the program")
    options = parser.parse_args(words)
    options.make_key = options.key is None
    if options.make_key:
        if not options.keys:
            parser.error("neither --key nor --keys is given; name a key, or the folder for a new one")
        options.key = os.path.join(options.keys, options.name + ".key")
    return options


def main(words):
    options = options_of(words)
    os.makedirs(options.out, exist_ok=True)
    scene = Scene(options)
    with open(scene.file("scene.lock"), "ab") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            print(f"scene: {options.name}: another job works on {options.out}; wait for it, or end it", file=sys.stderr)
            return 1
        scene.status["steps"] = read_json(scene.file(STATUS)).get("steps", {})
        if os.path.exists(scene.file(RESULT)):
            os.remove(scene.file(RESULT))  # of an older line of the table
        signal.signal(signal.SIGTERM, scene.on_signal)
        signal.signal(signal.SIGINT, scene.on_signal)
        try:
            result = scene.run()
        except (Failed, Ended, OSError) as error:
            state = "ended" if isinstance(error, Ended) else "failed"
            scene.save(state, reason=str(error))
            print(f"scene: {options.name}: {scene.status.get('step')}: {error}\n"
                  f"scene: {options.name}: all that was printed is in {scene.file(LOG)}", file=sys.stderr)
            return 1
        scene.save("finished", reason=None)
        write_json(scene.file(RESULT), result)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
