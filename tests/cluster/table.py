# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
"""What is said of bad tables, and what the page has of every kind of scene; a job on a program that only pretends."""

import csv
import json
import os
import signal
import stat
import subprocess
import sys
import tempfile
import time
import unittest

import captures
import page
import scene

# A tool that writes what a job looks for. PRETEND names the step that is ended by a signal, fails, or waits.
PRETENDED = """#!/bin/sh
step=$1
out='' json='' html=''
while [ $# -gt 0 ]; do
  case $1 in --out) out=$2 ;; --html) html=$2 ;; --json) json=${2:-} ;; esac
  shift
done
echo "$step" >>"$TRACE"
case ${PRETEND:-} in
  "$step fails") echo "compmark: error: scene: --data: is broken; mend it" >&2; exit 2 ;;
  "$step is killed") kill -9 $$ ;;
  "$step waits") exec sleep 60 ;;
esac
case $step in
  probe) echo '{"views_test": 2}' ;;
  keygen) (umask 077 && echo secret >"$out") ;;
  claim) echo claim >"$out" ;;
  train)
    mkdir -p "$out"
    for file in model.cmk results.json report.html unmarked.cmk; do echo "$step" >"$out/$file"; done ;;
  evaluate) echo '{"psnr": 30.25, "psnr_cost_vs_unmarked": 0.125}' >"$json" && : >"$html" ;;
  render) mkdir "$out" && : >"$out/a.png" ;;
  verify) echo '{"verdict": "not_detected", "matches": 25, "bits": 48, "p_value": 0.4}' >"$json"; exit 1 ;;
esac
"""
STEPS = ["probe", "keygen", "claim", "train", "evaluate", "render", "verify"]


class Folder(unittest.TestCase):
    def setUp(self):
        self.scratch = tempfile.TemporaryDirectory()
        self.addCleanup(self.scratch.cleanup)
        os.makedirs(self.path("captures", "fox"))

    def path(self, *parts):
        return os.path.join(self.scratch.name, *parts)

    def write(self, name, text, mode="w", **more):
        with open(self.path(name), mode, **more) as file:
            file.write(text)
        return self.path(name)

    def read(self, name):
        with open(self.path(name), encoding="utf-8") as file:
            return file.read()


class Tables(Folder):
    def faults(self, text, name="captures.tsv"):
        with self.assertRaises(captures.Faults) as caught:
            captures.read_table(self.write(name, text, encoding="utf-8", newline=""))
        return caught.exception.lines

    def refused(self, text, line, field, *words, **more):
        """One line that names file, line, field and what to do."""
        faults = self.faults(text, **more)
        self.assertEqual(len(faults), 1, faults)
        self.assertIn(f"captures.{'csv' if more else 'tsv'}, line {line}: {field}: ", faults[0])
        for word in words:
            self.assertIn(word, faults[0])
        self.assertRegex(faults[0], "; .")

    def test_a_table_is_read(self):
        self.write("owner.key", "")
        text = ("name\tcapture\tseed\tkey\titerations\tdownscale\toptions\r\n"
                "fox\tcaptures/fox\t3\towner.key\t1000\t1.5\t--lambda 0.002 --note 'two words'\r\n\r\n"
                f"Fox.2\t{self.path('captures', 'fox')}\r\n")
        first, second = captures.read_table(self.write("captures.tsv", "\ufeff" + text, encoding="utf-8", newline=""))
        self.assertEqual((first.name, first.line, second.line), ("fox", 2, 4))
        self.assertEqual(first.options, ["--lambda", "0.002", "--note", "two words"])
        self.assertEqual(first.key, self.path("owner.key"))
        self.assertEqual(second.words(), ["--name", "Fox.2", "--capture", self.path("captures", "fox")])
        comma, = captures.read_table(self.write("captures.csv", 'capture,name\n"captures/fox",a\n'))
        self.assertEqual(comma.capture, first.capture)

    def test_bad_tables_are_refused_in_one_line(self):
        head = "name\tcapture\tseed\n"
        self.refused("name\tseed\nfox\t1\n", 1, "capture", "missing")
        self.refused("name\tcapture\tsede\nfox\tcaptures/fox\t1\n", 1, "sede", "no column", "seed")
        self.refused("name\tcapture\tname\nfox\tcaptures/fox\tx\n", 1, "name", "twice")
        self.refused(head + "fox\tcaptures/fox\nfox\tcaptures/fox\n", 3, "name", '"fox"', "line 2")
        self.refused(head + "fox\tcaptures/fox\nFOX\tcaptures/fox\n", 3, "name", '"FOX"', "line 2")
        for name in ("../fox", "a/b", ".fox", "a fox", "füchse", "-fox", "x" * 101):
            self.refused(f"{head}{name}\tcaptures/fox\n", 2, "name", "letters")
        self.refused(head + "\tcaptures/fox\n", 2, "name", "empty")
        self.refused(head + "fox\t\n", 2, "capture", "empty")
        self.refused(head + "fox\tcaptures/cat\n", 2, "capture", "captures/cat", "there is no folder")
        for seed in ("-1", "1.5", "x", "1e3", str(2**64)):
            self.refused(f"{head}fox\tcaptures/fox\t{seed}\n", 2, "seed", f'"{seed}"', "from 0 to")
        self.refused("name\tcapture\titerations\nfox\tcaptures/fox\t0\n", 2, "iterations", "from 1 to")
        for scale in ("0.5", "nan", "inf", "65", "half"):
            self.refused(f"name\tcapture\tdownscale\nfox\tcaptures/fox\t{scale}\n", 2, "downscale", "from 1 to 64")
        self.refused("name\tcapture\tkey\nfox\tcaptures/fox\tno.key\n", 2, "key", "no.key", "new key")
        self.refused("name\tcapture\toptions\nfox\tcaptures/fox\t--out=x\n", 2, "options", "--out", "leave it out")
        self.refused("name\tcapture\toptions\nfox\tcaptures/fox\t--note 'x\n", 2, "options", "quote")
        self.refused(head + "fox\tcaptures/fox\t1\t2\n", 2, "the line", "4 fields", "3 columns")
        self.refused('name,capture\nfox,"captures/fox\n', 2, "the line", "quotes", name="captures.csv")
        self.refused(head, 1, "name", "no scene")

    def test_every_fault_is_told_but_not_thousands(self):
        lines = self.faults("name\tcapture\tseed\n" + "fox\tcaptures/cat\t-1\n" * 30)
        self.assertEqual(len(lines), 30 + 30 + 29)
        self.assertEqual(len(str(captures.Faults(lines)).splitlines()), 21)

    def test_no_tables(self):
        for table, words in (("captures.ods", ".tsv nor .csv"), ("none.tsv", "No such file"), ("bytes.tsv", "UTF-8")):
            self.write("bytes.tsv", b"name\tcapture\nf\xff\tx\n", mode="wb")
            with self.assertRaisesRegex(captures.Faults, words):
                captures.read_table(self.path(table))

    def test_as_a_program(self):
        run = lambda text: subprocess.run([sys.executable, captures.__file__, self.write("captures.tsv", text)],
                                          capture_output=True, text=True, check=False)
        good, bad = run("name\tcapture\nfox\tcaptures/fox\n"), run("name\tcapture\nfox\tno\n")
        self.assertEqual((good.returncode, good.stdout.split(": ")[1]), (0, "1 scenes\n"))
        self.assertEqual((bad.returncode, bad.stdout), (2, ""))
        self.assertIn("line 2: capture", bad.stderr)


class Jobs(Folder):
    def setUp(self):
        super().setUp()
        os.chmod(self.write("compmark", PRETENDED), 0o755)

    def words(self, *more):
        return [sys.executable, scene.__file__, "--name", "fox", "--capture", self.path("captures", "fox"),
                "--out", self.path("out", "scenes", "fox"), "--keys", self.path("out", "keys"),
                "--compmark", self.path("compmark"), *more]

    def environment(self, pretend):
        self.write("trace", "")
        return {**os.environ, "TRACE": self.path("trace"), "PRETEND": pretend}

    def job(self, *more, pretend=""):
        """Exit status, the steps that ran, and the scene's row of the page."""
        done = subprocess.run(self.words(*more), env=self.environment(pretend), capture_output=True, text=True,
                              check=False)
        return done.returncode, self.read("trace").split(), self.row()

    def row(self):
        return page.state_of(self.path("out", "scenes", "fox"), "fox")

    def test_from_the_key_to_the_proof_and_not_again(self):
        code, steps, row = self.job("--seed", "5", "--options=--lambda 0.002")
        self.assertEqual((code, steps), (0, STEPS))
        self.assertEqual((row["state"], row["verdict"], row["bits_right"], row["psnr"]),
                         ("finished", "not_detected", 25, 30.25))
        self.assertEqual(row["bytes"], len("train\n"))
        self.assertEqual(row["picture"], "renders/a.png")
        self.assertEqual(stat.S_IMODE(os.stat(self.path("out", "keys", "fox.key")).st_mode), 0o600)
        log = self.read("out/scenes/fox/scene.log")
        self.assertIn("--resume --seed 5 --lambda 0.002 --threads 1", log)
        self.assertEqual(self.job("--seed", "5", "--options=--lambda 0.002")[:2], (0, []))
        # Another seed is another training, and all that follows; key and claim stay.
        self.assertEqual(self.job("--seed", "6")[:2], (0, STEPS[3:]))

    def test_a_failure_is_kept_with_its_reason_and_gone_on_from(self):
        code, steps, row = self.job(pretend="evaluate fails")
        self.assertEqual((code, steps), (1, STEPS[:5]))
        self.assertEqual((row["state"], row["step"]), ("failed", "evaluate"))
        self.assertEqual(row["reason"], "compmark: error: scene: --data: is broken; mend it")
        self.assertEqual(self.job()[:2], (0, STEPS[4:]))

    def test_what_the_system_ends_is_said_to_be(self):
        code, _, row = self.job(pretend="train is killed")
        self.assertEqual((code, row["state"], row["step"]), (1, "failed", "train"))
        self.assertIn("SIGKILL", row["reason"])

    def test_a_lost_key_is_not_made_again(self):
        self.job(pretend="train fails")
        os.remove(self.path("out", "keys", "fox.key"))
        code, steps, row = self.job()
        self.assertEqual((code, steps, row["step"]), (1, [], "keygen"))
        self.assertIn("no longer there", row["reason"])

    def begun(self):
        job = subprocess.Popen(self.words(), env=self.environment("train waits"), stderr=subprocess.DEVNULL,
                               start_new_session=True)
        for _ in range(400):
            if self.row()["step"] == "train" and "train" in self.read("trace"):
                return job
            time.sleep(0.05)
        self.fail("the training did not begin")

    def test_a_killed_job_is_known_and_gone_on_from(self):
        job = self.begun()
        self.assertEqual(self.row()["state"], "running")
        second = subprocess.run(self.words(), env=self.environment(""), capture_output=True, text=True, check=False)
        self.assertEqual((second.returncode, "another job works on" in second.stderr), (1, True))
        os.killpg(job.pid, signal.SIGKILL)
        job.wait()
        self.assertEqual(self.row()["state"], "killed")
        self.assertEqual(self.job()[:2], (0, STEPS[3:]))

    def test_a_job_that_is_told_to_end_says_so(self):
        job = self.begun()
        os.killpg(job.pid, signal.SIGTERM)
        self.assertEqual(job.wait(), 1)
        row = self.row()
        self.assertEqual((row["state"], row["step"]), ("ended", "train"))
        self.assertIn("SIGTERM", row["reason"])


class Pages(Folder):
    def test_every_scene_is_on_the_page(self):
        names = ("done", "broken", "killed", "new")
        table = self.write("captures.tsv", "name\tcapture\n" + "".join(f"{name}\tcaptures/fox\n" for name in names))
        for name, status in (("done", {"state": "finished"}),
                             ("broken", {"state": "failed", "step": "train", "reason": "a <b> & c", "steps":
                                         {"train": {"seconds": 7200, "processor_seconds": 3600}}}),
                             ("killed", {"state": "running", "step": "render", "alive": 0, "host": "elsewhere"})):
            os.makedirs(self.path("out", "scenes", name))
            scene.write_json(self.path("out", "scenes", name, "status.json"), status)
        scene.write_json(self.path("out", "scenes", "done", "result.json"), {
            "psnr": 31.126, "psnr_cost_vs_unmarked": None, "bytes": 1234567, "bits_right": 48, "bits": 48,
            "p_value": 3.6e-15, "verdict": "detected", "standing": "conditional", "seconds": 90,
            "processor_seconds": 3600, "picture": "renders/a b.png"})
        self.write("out/scenes/done/proof.json", "{}")
        self.assertEqual(page.main([table, self.path("out")]), 0)
        text = self.read("out/index.html")
        for piece in ("31.13", "1,234,567", "48 of 48", "3.6e-15", "detected, conditionally", "90 s",
                      "a &lt;b&gt; &amp; c", "failed in train", "killed in render", "not begun",
                      'href="scenes/done/proof.json"',
                      'src="scenes/done/renders/a%20b.png"'):
            self.assertIn(piece, text)
        self.assertNotIn("<b> & c", text)
        self.assertLess(text.index(">broken<"), text.index(">done<"))
        data = json.loads(self.read("out/scenes.json"))
        self.assertEqual([row["name"] for row in data["scenes"]], list(names))
        totals = data["totals"]
        self.assertEqual([totals[key] for key in ("scenes", "finished", "failed", "killed", "not_begun", "detected")],
                         [4, 1, 1, 1, 1, 1])
        self.assertEqual((totals["bytes"], totals["processor_hours"]), (1234567, 2))
        with open(self.path("out", "scenes.tsv"), encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file, delimiter="\t"))
        self.assertEqual([row["state"] for row in rows], ["finished", "failed", "killed", "not begun"])
        self.assertEqual((rows[0]["proof"], rows[0]["psnr_cost_vs_unmarked"]), ("scenes/done/proof.json", ""))
        self.assertEqual([name for name in os.listdir(self.path("out")) if "part" in name], [])


if __name__ == "__main__":
    unittest.main()
