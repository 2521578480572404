# SPDX-License-Identifier: Apache-2.0
# shellcheck shell=bash
# For tests of command lines, sourced after `program` (its path) was set: a folder of its own, one TAP line for each
# `finish`, and what programs of this project have in common. End with tap_end.

dir=$(mktemp -d) || exit 2
child=
trap '[[ $child ]] && kill -KILL "$child" 2>/dev/null; rm -rf -- "$dir"' EXIT
cd -- "$dir" || exit 2
mkdir out

tests=0 failures=0 problems=()
program_name=$(basename -- "$program")

problem() { problems+=("$*"); }

# One TAP line for all that was checked since the last one.
finish() {
    tests=$((tests + 1))
    if [[ ${#problems[@]} -eq 0 ]]; then
        echo "ok $tests - $1"
    else
        failures=$((failures + 1))
        echo "not ok $tests - $1"
        printf '# %s\n' "${problems[@]}"
    fi
    problems=()
}

skip() {
    tests=$((tests + 1))
    echo "ok $tests - $1 # SKIP $2"
}

# run ARGS...: the program with its output in the files stdout and stderr, its exit status in rc
run() {
    timeout 60 "$program" "$@" >stdout 2>stderr
    rc=$?
    read_said
}

# What stands on stderr, as lines in said_lines and together in said.
read_said() {
    mapfile said_lines <stderr
    said="${said_lines[*]-}"
    said=${said//$'\n'/|}
}

good() {
    run "$@"
    [[ $rc -eq 0 ]] || problem "exit $rc instead of 0: $* ($said)"
}

quiet_good() {
    good --quiet "$@"
    [[ ! -s stdout && ! -s stderr ]] || problem "--quiet is not quiet: $* ($said)"
}

lines() {
    local all
    mapfile all <"$1"
    echo ${#all[@]}
}

# clean_failure EXIT WORD ARGS...: one line on stderr that holds WORD, nothing on stdout, no file in out/
clean_failure() {
    local status=$1 word=$2
    shift 2
    run "$@"
    [[ " $status " == *" $rc "* ]] || problem "exit $rc instead of $status: ${*@Q} ($said)"
    [[ ! -s stdout ]] || problem "something on standard output: ${*@Q}"
    [[ ${#said_lines[@]} -eq 1 && $said == *'|' ]] ||
        problem "not exactly one line on standard error: ${*@Q} ($said)"
    [[ $said == *"$word"* && $said == "$program_name:"* ]] || problem "message without '$program_name:' and '$word': ${*@Q} ($said)"
    nothing_left "${*@Q}"
}

nothing_left() {
    local left=(out/*)
    [[ ${#left[@]} -eq 0 ]] && return
    problem "left behind: ${left[*]}: $1"
    rm -rf out && mkdir out
}

hex() { od -An -v -tx1 | tr -d ' \n'; }

# is_exr FILE [VERSION]: the version is 02020000 with tiles
is_exr() {
    local start
    start=$(head -c 8 "$1" 2>/dev/null | hex)
    [[ $start == 762f3101${2:-02000000} ]] || problem "$1 is no such EXR file: starts with '$start'"
}

is_png() {
    local start end
    start=$(head -c 8 "$1" 2>/dev/null | hex)
    end=$(tail -c 8 "$1" 2>/dev/null | hex)
    [[ $start == 89504e470d0a1a0a && $end == 49454e44ae426082 ]] || problem "$1 is no complete PNG file"
}

no_temporaries() {
    local left=("${1:-.}"/*.tmp*)
    [[ ${#left[@]} -eq 0 ]] || problem "temporary files left: ${left[*]}"
}

# same A B: as of content
same() { [[ $(sha256sum <"$1") == "$(sha256sum <"$2")" ]]; }

# Fills figure[PATH] from a JSON file with one item a line.
declare -A figure
read_json() {
    local line path='' item='^[[:space:]]*"([^"]+)":[[:space:]]*([^,]*),?$' close='^[[:space:]]*\},?$'
    figure=()
    while IFS= read -r line; do
        if [[ $line =~ $item ]]; then
            if [[ ${BASH_REMATCH[2]} == '{' ]]; then
                path+=${BASH_REMATCH[1]}.
            else
                figure[$path${BASH_REMATCH[1]}]=${BASH_REMATCH[2]}
            fi
        elif [[ $line =~ $close && $path ]]; then
            path=${path%.}
            if [[ $path == *.* ]]; then path=${path%.*}.; else path=; fi
        fi
    done <"$1"
    if [[ $python ]] && ! "$python" -m json.tool "$1" >/dev/null 2>&1; then
        problem "$1 is not JSON"
    fi
}

has_keys() {
    local key
    for key; do
        [[ ${figure[$key]-} ]] || problem "JSON without $key"
    done
}

figure_is() {
    [[ ${figure[$1]-} == "$2" ]] || problem "$1 is ${figure[$1]-missing} instead of $2"
}

# All that does not depend on the clock.
steady_figures() {
    local key
    for key in "${!figure[@]}"; do
        [[ $key == *_s || $key == speedup.frame* || $key == speedup.shade ]] || echo "$key ${figure[$key]}"
    done | sort
}

# lamp_gltf INTENSITY X,Y,Z: a scene of a triangle in the plane z = 0 and a point light
lamp_gltf() {
    local gltf='{"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0,1]}],"nodes":[{"mesh":0},{"translation":[%s],'
    gltf+='"extensions":{"KHR_lights_punctual":{"light":0}}}],"extensionsUsed":["KHR_lights_punctual"],"extensions":'
    gltf+='{"KHR_lights_punctual":{"lights":[{"type":"point","intensity":%s}]}},"meshes":[{"primitives":[{"attributes":'
    gltf+='{"POSITION":0}}]}],"accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],'
    gltf+='"max":[1,1,0]}],"bufferViews":[{"buffer":0,"byteLength":36}],"buffers":[{"byteLength":36,"uri":'
    gltf+='"data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}]}'
    # shellcheck disable=SC2059
    printf "$gltf" "$2" "$1"
}

python=$(command -v python3) || python=
[[ $python ]] && ! "$python" -c 'import json' 2>/dev/null && python=

ticks=$(getconf CLK_TCK)

# Starts the program in the background, as $child, and waits until it is into the rendering: it handles signals, and has
# used $settle (7) tenths of a second of CPU, however much else the machine does. Shells start background jobs with SIGINT
# ignored, which the program respects.
start() {
    env --default-signal=INT,TERM "$program" "$@" >stdout 2>stderr &
    child=$!
    local i status fields
    for i in {1..200}; do
        status=$(cat "/proc/$child/status" 2>/dev/null) || break
        [[ $status =~ SigCgt:[[:space:]]*([0-9a-f]+) ]] && ((16#${BASH_REMATCH[1]} & 2)) && break
        sleep 0.05
    done
    for i in {1..400}; do
        read -ra fields < <(sed 's/.*) //' "/proc/$child/stat" 2>/dev/null) || break
        ((fields[11] + fields[12] < ticks * ${settle-7} / 10)) || break
        sleep 0.05
    done
}

# Waits for the child: its exit status in rc, milliseconds in waited; killed after 20 s.
reap() {
    local begin now
    begin=$(date +%s%3N)
    while kill -0 "$child" 2>/dev/null; do
        now=$(date +%s%3N)
        if ((now - begin > 20000)); then
            problem "does not end within 20 s"
            kill -KILL "$child"
            break
        fi
        sleep 0.05
    done
    wait "$child" 2>/dev/null
    rc=$?
    child=
    waited=$(($(date +%s%3N) - begin))
    read_said
}

# SIGINT comes while a scene is read that takes longer than a second: older files are as they were, no new one is there.
interrupt_loading() {
    awk 'BEGIN { for (i = 0; i < 100000; i++)
        printf "v %d %d %d\nv %d.5 %d 0\nv %d 1 %d\nf -3 -2 -1\n", i % 100, i % 7, i % 13, i % 100, i % 11, i % 17, i % 5 }' >many.obj
    local quiet settle=0
    for quiet in '' --quiet; do
        echo older >out/old.exr
        echo older >out/old.json
        # shellcheck disable=SC2086
        start many.obj --size 64x64 --look 50,5,50,50,0,0,60 -o out/old.exr -o out/new.png --json out/old.json $quiet
        kill -INT "$child"
        reap
        [[ $rc -eq 130 ]] || problem "exit $rc instead of 130 ($said)"
        if [[ $quiet ]]; then
            [[ ! -s stdout && ! -s stderr ]] || problem "--quiet is not quiet ($said)"
        else
            [[ ! -s stdout && ${said_lines[-1]} == "notice: interrupted before the first pixel: nothing is written"* ]] ||
                problem "this is not said ($said)"
        fi
        [[ $(<out/old.exr) == older && $(<out/old.json) == older ]] || problem "an older file is gone"
        rm -f out/old.exr out/old.json
        nothing_left "interrupted while loading"
    done
    rm many.obj
    finish "SIGINT while a scene is read leaves all files as they are"
}

tap_end() {
    echo "1..$tests"
    [[ $failures -eq 0 ]]
}
