#!/bin/sh
# Global state exists once: plug-ins link no file of the core that has variables of its own: single_state.sh CORE_LIBRARY
# PART...
set -eu

core=$1
shift
! nm "$core" 2>/dev/null | grep -q ' __asan_init' || { echo 'skip: sanitizers give every file variables'; exit 77; }
# Functions of the core's files that have variables; C++ streams make one for every file that knows them.
with_state=$(objdump -t "$core" | awk '
    /file format/ { file = $1 }
    / \.(data|bss|tdata|tbss)(\.[^r]|\t| )/ && NF > 4 && $NF !~ /__ioinit|^DW\.ref|^\./ { state[file] = 1 }
    / F \.text/ && / g / { functions[file] = functions[file] " " $NF }
    END { for (file in state) print functions[file] }' | tr ' ' '\n' | grep .)
# It must see something.
printf '%s\n' "$with_state" | grep -qx cts_cpu_add || { echo 'single_state.sh is blind'; exit 1; }
for part in "$@"; do
    found=$(nm --defined-only "$part" | awk '$3 ~ /^cts_/ { print $3 }' | grep -xF -e "$with_state" || true)
    [ -z "$found" ] || {
        printf '%s has state of the core a second time, with:\n%s\n' "${part##*/}" "$found"
        exit 1
    }
done
