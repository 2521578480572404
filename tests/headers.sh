#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# headers.sh SOURCE_ROOT LIBVCACHE LIBHALTON [STATIC_LIBVCACHE STATIC_LIBHALTON]: public headers compile alone as C11 and C++17 without a warning; the
# libraries export what tests/promise.c lists, nothing without their prefix, and need libc alone. Prints TAP.
set -u
root=$1 n=0 bad=0
folder=$(mktemp -d) || exit 1
trap 'rm -rf "$folder"' EXIT

report() { # STATUS WHAT
    n=$((n + 1))
    if [ "$1" -eq 0 ]; then echo "ok $n - $2"; else echo "not ok $n - $2"; bad=1; fi
}

for header in vcache/vcache.h vcache/adaptive.h vcache/grid.h vcache/save.h halton/halton.h; do
    echo "#include \"$header\"" >"$folder/alone.c"
    cp "$folder/alone.c" "$folder/alone.cc"
    for compiler in cc c++ clang clang++; do
        if ! command -v $compiler >/dev/null; then
            n=$((n + 1)); echo "ok $n - $header with $compiler # SKIP no $compiler"
            continue
        fi
        case $compiler in *++) std=c++17 file=alone.cc ;; *) std=c11 file=alone.c ;; esac
        $compiler -std=$std -Wall -Wextra -Wpedantic -Werror -I"$root" -c "$folder/$file" -o /dev/null
        report $? "$header alone as $std with $compiler"
    done
done
foreign() { nm -D --defined-only "$1" | awk -v p="$2" '$3 !~ "^" p && $3 !~ /^(_init|_fini|_edata|_end|__bss_start)$/ { print "# " $3; f = 1 } END { exit f }'; }
foreign "$2" vcache_; report $? "libvcache exports vcache_ alone"
foreign "$3" halton_; report $? "libhalton exports halton_ alone"
cc -std=c11 -Wno-array-parameter -I"$root" -c "$root/tests/promise.c" -o "$folder/promise.o" 2>&1 | sed 's/^/# /'
[ -e "$folder/promise.o" ]; report $? "types, constants and fields are as promised"
{ nm -D --defined-only "$2"; nm -D --defined-only "$3"; } | awk '$3 ~ /^(vcache|halton)_/ { print $3 }' | sort >"$folder/exported"
grep -oE '\b(vcache|halton)_[a-z0-9_]+\(' "$root/tests/promise.c" | tr -d '(' | sort >"$folder/promised"
diff "$folder/promised" "$folder/exported" >"$folder/log"
report $? "the libraries export the functions of tests/promise.c, all of them: $(tr '\n' ' ' <"$folder/log")"
internal() { nm --defined-only --extern-only "$1" | awk -v p="$2" 'NF == 3 && $3 !~ "^" p { print "# " $3 " (vcache/names.h)"; f = 1 } END { exit f }'; }
if [ $# -ge 5 ]; then
    internal "$4" vcache_; report $? "the static libvcache has names with vcache_ alone"
    internal "$5" halton_; report $? "the static libhalton has names with halton_ alone"
fi
needs() { readelf -d "$1" | awk '/NEEDED/ && $0 !~ /lib(c|m|asan|ubsan|tsan|gcc_s)\.so|ld-linux/ { print "#" $0; f = 1 } END { exit f }'; }
needs "$2"; report $? "libvcache needs libc alone"
needs "$3"; report $? "libhalton needs libc alone"
echo "1..$n"
exit $bad
