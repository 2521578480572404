#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""comments.py HEADER: a header's plain comments as Doxygen wants them. Declarations in a row share the comment in front of
the first, fields declared together the comment behind them."""
import re
import sys

lines = open(sys.argv[1], encoding="utf-8").read().split("\n")
comment, shared, begun, inside, out = [], False, False, False, []
for number, line in enumerate(lines):
    divider = re.fullmatch(r"/\* -{10,} *(.*\S) \*/", line)
    if inside or line.lstrip().startswith("/*"):
        if not inside:
            comment = []
            line = "/** \\name %s */" % divider.group(1) if divider else line.replace("/*", "/**", 1)
            if number == 1:
                line = line.replace("/**", "/** \\file\n *", 1)
        comment.append(line)
        inside = "*/" not in line
        shared = False
    elif not line:
        comment, shared = [], False
    else:
        starts = re.match(r"(VCACHE_API|HALTON_API|typedef|#define) ", line)
        if starts and shared and not begun:
            out += comment
        begun = (starts or begun) and not line.endswith(";") and not line.startswith("#")
        fields = re.fullmatch(r"( +)(\S.*?) (\*?\w+(?:\[\d+\])*(?:, \*?\w+(?:\[\d+\])*)+); */\* (.*)", line)
        if fields:
            indent, kind, names, text = fields.groups()
            for later in lines[number + 1:]:
                if "*/" in text:
                    break
                text += " " + later.strip()
            *names, last = names.split(", ")
            out += ["%s%s %s; /**< %s" % (indent, kind, name, text) for name in names]
            line = "%s%s %s; /* %s" % (indent, kind, last, fields.group(4))
        line = re.sub(r"(\S) */\* ", r"\1 /**< ", line)
        inside = "/**<" in line and "*/" not in line
        if inside:
            begun = True
        # another after the end of this one
        shared = bool(comment) and not line.startswith(("#if", "#endif", "#else", "#include"))
    out.append(line)
print("\n".join(out))
