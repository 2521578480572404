#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""documents.py SOURCES BUILD: what the documents show is what is there. Prints TAP.
documents.py INSTALLED: the links of installed documents alone; prints those that lead nowhere.
- a fenced block whose language is followed by a file's path stands in that file, line by line (`...`: lines left out);
- a block of `$ build/examples/NAME` and what it prints is printed by it, numbers within a tenth or two units of the last
  digit: other compilers round otherwise, threads race;
- each example is shown with its figures somewhere;
- files and programs named in code quotes exist, and so do the test cases in the last column of troubleshooting.md;
- relative links lead to files."""
import glob
import os
import re
import subprocess
import sys

root = sys.argv[1]
build = sys.argv[2] if len(sys.argv) > 2 else None
documents = sorted(glob.glob(root + "/docs/*.md")) + [root + "/README.md", root + "/examples/README.md"]
NUMBER = re.compile(r"\d+(?:\.\d+)?")
outputs, shown, results = {}, set(), []


def report(problems, what):
    results.append((problems, what))


def run(name, arguments):
    key = (name, arguments)
    if key not in outputs:
        done = subprocess.run([os.path.join(build, "examples", name)] + arguments.split(), capture_output=True, text=True,
                              timeout=300)
        outputs[key] = done.stdout.rstrip("\n").split("\n") if done.returncode == 0 else [done.stderr]
    return outputs[key]


def near(a, b):
    if NUMBER.sub("#", a) != NUMBER.sub("#", b):
        return False
    for x, y in zip(NUMBER.findall(a), NUMBER.findall(b)):
        digits = len(x.partition(".")[2])
        if abs(float(x) - float(y)) > max(0.1 * float(x), 2 * 10.0 ** -digits):
            return False
    return True


def console(lines):
    problems = []
    for i, line in enumerate(lines):
        match = re.match(r"\$ build/examples/(\w+)(.*)$", line)
        if not match:
            continue
        shown.add(match.group(1))
        said = []
        for other in lines[i + 1:]:
            if other.startswith("$"):
                break
            said.append(other)
        if not os.path.exists(os.path.join(build, "examples", match.group(1))):
            continue  # not built: no C++, no renderers
        real = run(match.group(1), match.group(2))
        if len(real) != len(said) or not all(near(a, b) for a, b in zip(said, real)):
            problems += ["%s prints" % match.group(1)] + real + ["and the document says"] + said
    return problems


def excerpt(lines, path):
    try:
        text = [line.strip() for line in open(os.path.join(root, path), encoding="utf-8")]
    except OSError:
        return ["no file " + path]
    at = 0
    parts = [[]]
    for line in lines:
        if line.strip() == "...":
            parts.append([])
        else:
            parts[-1].append(line.strip())
    for part in filter(None, parts):
        while at + len(part) <= len(text) and text[at:at + len(part)] != part:
            at += 1
        if at + len(part) > len(text):
            return ["not in %s, or not in this order:" % path] + part
        at += len(part)
    return []


def dead_links(path, line):
    return ["no such file: " + link for link in re.findall(r"\]\(([^)#\s]+)[^)]*\)", line)
            if "://" not in link and not os.path.exists(os.path.join(os.path.dirname(path), link))]


if not build:
    dead = ["%s: %s" % (path, problem) for path in documents
            for problem in dead_links(path, open(path, encoding="utf-8").read())]
    print("\n".join(dead))
    sys.exit(bool(dead))

for path in documents:
    name = os.path.relpath(path, root)
    problems, info, block = [], None, []
    for line in open(path, encoding="utf-8").read().split("\n"):
        fence = re.match(r"```(.*)$", line)
        if fence and info is None:
            info, block = fence.group(1).split(), []
        elif fence:
            if len(info) == 2:
                problems += excerpt(block, info[1])
            elif info == ["console"]:
                problems += console(block)
            info = None
        elif info is not None:
            block.append(line)
        else:
            problems += dead_links(path, line)
    report(problems, name)

missing = []
cases = "".join(open(path, encoding="utf-8").read() for path in glob.glob(root + "/tests/test_*.c"))
for path in documents:
    for line in open(path, encoding="utf-8").read().split("\n"):
        for name in re.findall(r"`((?:build/|)(?:tests|examples|bench|vcache|docs|scripts)/[\w/.-]+)[` ]", line):
            source = os.path.join(root, re.sub("^build/", "", name))
            if "NAME" not in name and not any(os.path.exists(source + end) for end in ("", ".c", ".cpp")):
                missing.append("%s: there is no %s" % (os.path.relpath(path, root), name))
        if path.endswith("troubleshooting.md") and line.startswith("| ") and not line.startswith(("| what", "| ---")):
            shown_by = re.findall(r"`([a-z_]+)`", line.split(" | ")[-1])
            missing += ["no test case " + name for name in shown_by if "static void %s(" % name not in cases]
            if not line.split(" | ")[-1].strip(" |"):
                missing.append("nothing shows " + line)
report(missing, "files, programs and test cases that are named")

missing = []
for source in sorted(glob.glob(root + "/examples/*.c*")):
    example = os.path.splitext(os.path.basename(source))[0]
    if example not in shown:
        missing.append(example + " is shown nowhere")
report(missing, "each example is shown with its figures")

print("1..%d" % len(results))
for number, (problems, what) in enumerate(results, 1):
    print("%sok %d - %s" % ("not " if problems else "", number, what))
    for problem in problems:
        print("# " + problem)
sys.exit(any(problems for problems, _ in results))
