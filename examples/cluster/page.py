#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
"""One page (index.html) and one table (scenes.json, scenes.tsv) of all scenes, as far as they are.

    page.py TABLE FOLDER     FOLDER is --config out=... of the Snakefile, which calls this when it ends

A scene that failed, was killed or never began is in both, with the reason. The page has no script and loads nothing but
the pictures of its own folder.
"""

import csv
import html
import io
import json
import os
import socket
import sys
import time
from urllib.parse import quote

import captures
import scene as job

SILENT = 12 * job.HEARTBEAT  # seconds after which a job that said nothing is taken for killed
ORDER = ("failed", "killed", "ended", "running", "not begun", "finished")
FIGURES = ("psnr", "psnr_cost_vs_unmarked", "bytes", "bits_right", "bits", "p_value", "verdict", "standing", "views",
           "seconds", "processor_seconds", "sessions", "threads", "peak_memory_mb")
# What a row links to, where it is there. The proof names the message: the page is the owner's.
LINKS = (("report", "run/report.html"), ("figures", "evaluation.html"), ("proof", "proof.json"),
         ("claim", "owner.claim"), ("file", "run/model.cmk"), ("log", job.LOG))
STYLE = """
:root{--ink:#16202c;--soft:#5b6878;--line:#dfe4ea;--paper:#fff;--panel:#f6f8fa;--bad:#b3261e;color-scheme:light dark}
@media(prefers-color-scheme:dark){:root{--ink:#e6ebf1;--soft:#98a5b5;--line:#2d3742;--paper:#12171d;--panel:#1a2129;
--bad:#f2857e}}
body{margin:0 auto;max-width:1240px;padding:28px 20px 60px;background:var(--paper);color:var(--ink);
font:15px/1.5 system-ui,sans-serif}
h1{margin:0;font-size:28px} h2{margin:36px 0 12px;font-size:18px} p.sub{margin:2px 0 20px;color:var(--soft)}
.figures{display:flex;flex-wrap:wrap;gap:10px}
.figures div{background:var(--panel);border:1px solid var(--line);border-radius:8px;padding:10px 16px}
.figures b{display:block;font-size:21px;font-variant-numeric:tabular-nums}
.figures span{color:var(--soft);font-size:13px}
.scroll{overflow-x:auto} table{border-collapse:collapse;width:100%;font-variant-numeric:tabular-nums}
td,th{padding:4px 12px 4px 0;border-bottom:1px solid var(--line);text-align:left;vertical-align:middle;
white-space:nowrap}
td.n,th.n{text-align:right} td.why{white-space:normal;overflow-wrap:anywhere}
td img{height:56px;display:block;border-radius:4px}
.bad{color:var(--bad);font-weight:600} a{color:inherit}
"""


def is_alive(status):
    """Whether the job that wrote this is still there: seen at once on its own machine, and elsewhere by its silence."""
    if status.get("host") == socket.gethostname():
        try:
            os.kill(status["process"], 0)
        except ProcessLookupError:
            return False
        except (KeyError, TypeError, OSError):
            pass  # another's process, or none that can be asked for
    return time.time() - status.get("alive", 0) <= SILENT


def state_of(folder, name):
    """A scene as its folder tells it: the fields of the table."""
    status, result = job.read_json(os.path.join(folder, job.STATUS)), job.read_json(os.path.join(folder, job.RESULT))
    row = {"name": name, "state": "not begun", "step": None, "reason": None, **dict.fromkeys(FIGURES)}
    if result:
        row.update(state="finished", **{figure: result.get(figure) for figure in FIGURES})
    elif status:
        steps = status.get("steps", {}).values()
        row.update(state=status.get("state"), step=status.get("step"), reason=status.get("reason"),
                   seconds=round(sum(step.get("seconds", 0) for step in steps), 1),
                   processor_seconds=round(sum(step.get("processor_seconds", 0) for step in steps), 1))
        if row["state"] == "finished":  # between the last step and result.json
            row.update(state="killed", reason="ended after its last step; the next call finishes it at once")
        elif row["state"] == "running" and not is_alive(status):
            row.update(state="killed", reason="nothing was heard of it since "
                       + time.strftime("%Y-%m-%d %H:%M:%S UTC", time.gmtime(status.get("alive", 0)))
                       + ", it was killed: the next call goes on")
    row["picture"] = result.get("picture")
    row["links"] = {what: file for what, file in LINKS if os.path.exists(os.path.join(folder, file))}
    return row


def collect(scenes, out):
    rows = []
    for one in scenes:
        row = state_of(os.path.join(out, "scenes", one.name), one.name)
        prefix = f"scenes/{one.name}/"
        row["links"] = {what: prefix + file for what, file in row["links"].items()}
        row["picture"] = prefix + row["picture"] if row["picture"] else None
        rows.append(row)
    return rows


def is_detected(row):
    """Whether the mark was read, and could not have been made so."""
    return row["verdict"] == "detected" and row["standing"] != "not_a_proof"


def totals(rows):
    finished = [row for row in rows if row["state"] == "finished"]
    return {
        "scenes": len(rows),
        **{state.replace(" ", "_"): sum(row["state"] == state for row in rows) for state in ORDER},
        "detected": sum(is_detected(row) for row in finished),
        "bytes": sum(row["bytes"] or 0 for row in finished),
        "processor_hours": round(sum(row["processor_seconds"] or 0 for row in rows) / 3600, 3),
    }


def duration(seconds):
    if seconds is None:
        return ""
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"


def number(value, form):
    return "" if value is None else format(value, form)


def cells(row):
    """The cells of a row of the page: class, HTML."""

    def link(what, text):
        there = row["links"].get(what)
        return f'<a href="{html.escape(quote(there))}">{text}</a>' if there else text

    name = link("report", html.escape(row["name"]))
    if row["state"] != "finished":
        where = f" in {row['step']}" if row["step"] and row["state"] != "not begun" else ""
        yield "", ""
        yield "", name
        bad = "" if row["state"] in ("not begun", "running") else "bad"
        yield f'why" colspan="6', (f'<span class="{bad}">{html.escape(str(row["state"]) + where)}</span>'
                                   + (f": {html.escape(row['reason'])}" if row["reason"] else ""))
    else:
        picture = row["picture"] and html.escape(quote(row["picture"]))
        yield "", f'<img loading="lazy" alt="" src="{picture}">' if picture else ""
        yield "", name
        yield "n", number(row["psnr"], ".2f")
        yield "n", number(row["psnr_cost_vs_unmarked"], ".2f")
        yield "n", number(row["bytes"], ",")
        yield "n", "" if row["bits"] is None else f"{row['bits_right']} of {row['bits']}"
        yield "n", number(row["p_value"], ".1e")
        verdict = "not a proof" if row["standing"] == "not_a_proof" else str(row["verdict"]).replace("_", " ")
        verdict = html.escape(verdict + (", conditionally" if row["standing"] == "conditional" else ""))
        yield "", verdict if is_detected(row) else f'<span class="bad">{verdict}</span>'
    yield "n", duration(row["seconds"])
    yield "n", duration(row["processor_seconds"])
    yield "n", number(row["peak_memory_mb"], ",")
    yield "", " ".join(link(what, what) for what, _ in LINKS if what in row["links"])


def page(rows, title):
    sums = totals(rows)
    tiles = [("scenes", sums["scenes"]), ("finished", sums["finished"]), ("mark detected", sums["detected"]),
             ("failed", sums["failed"]), ("killed, ended or running", sums["killed"] + sums["ended"] + sums["running"]),
             ("not begun", sums["not_begun"]), ("bytes of all files", f"{sums['bytes']:,}"),
             ("processor hours", f"{sums['processor_hours']:.2f}")]
    heads = [("", ""), ("", "scene"), ("n", "PSNR, dB"), ("n", "lost to the mark, dB"), ("n", "bytes"), ("n", "bits"),
             ("n", "p-value"), ("", "verdict"), ("n", "time"), ("n", "processor"), ("n", "memory, MB"), ("", "")]
    text = ('<!doctype html><html lang="en"><head><meta charset="utf-8">'
            '<meta name="viewport" content="width=device-width,initial-scale=1">'
            f"<title>{html.escape(title)}</title><style>{STYLE}</style></head><body>\n<h1>{html.escape(title)}</h1>"
            f'<p class="sub">{time.strftime("%Y-%m-%d %H:%M UTC", time.gmtime())}. Figures are of the files, decoded '
            "and read by other processes. Detected, conditionally: a proof if the claim was published before "
            "anybody else had anything that shows the scene. Proofs name the messages: this page is for the owner.</p>\n"
            '<div class="figures">')
    text += "".join(f"<div><b>{value}</b><span>{name}</span></div>" for name, value in tiles) + "</div>\n"
    text += '<h2>Scenes</h2><div class="scroll"><table><tr>'
    text += "".join(f'<th class="{kind}">{name}</th>' for kind, name in heads) + "</tr>\n"
    for row in sorted(rows, key=lambda row: ORDER.index(row["state"])):  # what needs a look comes first
        text += "<tr>" + "".join(f'<td class="{kind}">{cell}</td>' for kind, cell in cells(row)) + "</tr>\n"
    return text + "</table></div></body></html>\n"


def table(rows):
    columns = ("name", "state", "step", "reason") + FIGURES + tuple(what for what, _ in LINKS)
    text = io.StringIO()
    writer = csv.writer(text, delimiter="\t", lineterminator="\n")
    writer.writerow(columns)
    for row in rows:
        values = {**row, **row["links"]}
        writer.writerow(["" if values.get(column) is None else values[column] for column in columns])
    return text.getvalue()


def write(scenes, out, title):
    """Writes the three files, each whole or not at all, and says what there is in a line."""
    rows = collect(scenes, out)
    os.makedirs(out, exist_ok=True)
    data = {"schema": "compmark.cluster.1", "totals": totals(rows), "scenes": rows}
    for name, text in (("index.html", page(rows, title)), ("scenes.tsv", table(rows)),
                       ("scenes.json", json.dumps(data, indent=2) + "\n")):
        part = os.path.join(out, f"{name}.{os.getpid()}.part")
        with open(part, "w", encoding="utf-8", newline="") as file:
            file.write(text)
        os.replace(part, os.path.join(out, name))
    sums = data["totals"]
    return (f"{sums['scenes']} scenes: {sums['finished']} finished, {sums['detected']} of them with their mark "
            f"detected, {sums['failed']} failed, {sums['scenes'] - sums['finished'] - sums['failed']} not finished; "
            f"the page: {os.path.join(out, 'index.html')}")


def main(words):
    if len(words) != 2:
        print("page: give the table and the folder of the run: page.py TABLE FOLDER", file=sys.stderr)
        return 2
    try:
        # Captures may lie elsewhere by now: the page is of what was made of them.
        print(write(captures.read_table(words[0], files=False), words[1], os.path.basename(words[0])))
    except captures.Faults as faults:
        print(faults, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
