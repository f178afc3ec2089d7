#!/bin/sh
# What a machine can see of the house's style: style.sh SOURCE_ROOT
set -eu

# texts ROOT: the files that people write
texts()
{
    (cd "$1" && find . \( -name '.git' -o -name 'build*' -o -path './out' -o -path './testdata' \) -prune -o \
        -type f \( -name '*.c' -o -name '*.cc' -o -name '*.h' -o -name '*.py' -o -name '*.sh' -o -name '*.md' -o \
        -name '*.build' -o -name '*.1' -o -name '*.5' -o -name '*.txt' -o -name '*.json' -o -name '*.in' -o \
        -name dev -o -name run \) -print | LC_ALL=C sort)
}

# The tokens are spelt with a gap so that this file does not hold them.
marks='TO''DO|FIX''ME|(^|[^X])XX''X([^X]|$)|not built ''yet|place''holder|for ''now'
paths='(^|[^a-zA-Z0-9_.])/(wo''rk|fa''rm|ro''ot|ho''me)/'
fast='fast''-math|O''fast'

violations()
{
    texts "$1" | (
        cd "$1"
        tab=$(printf '\t')
        while read -r f; do
            grep -nE "[$tab ]+\$" "$f" | sed "s|^|$f: blank at the end of line |"
            grep -n "$tab" "$f" | sed "s|^|$f: tab in line |"
            [ -z "$(tail -c 1 "$f")" ] || echo "$f: no newline at the end"
            grep -nE "$paths" "$f" | sed "s|^|$f: path of a machine in line |"
            grep -niE "$marks" "$f" | sed "s|^|$f: mark of unfinished work in line |"
            grep -nE -e "-f($fast)|-$fast" "$f" | grep -v -e '-fno-' | sed "s|^|$f: unsafe floating point in line |"
            case $f in
            *.c | *.h | *.cc) awk -v f="$f" 'length > 120 { print f ": more than 120 columns in line " NR }' "$f" ;;
            esac
        done
    )
}

# breach TEXT: the check must see this one
breach()
{
    printf '%b' "$1" >"$work/a.c"
    [ -n "$(violations "$work")" ] || {
        printf 'style.sh is blind to: %s\n' "$1"
        exit 1
    }
}

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
breach 'int a; \n'
breach '\tint a;\n'
breach 'int a;'
breach '/* see /ro''ot/x */\n'
breach '/* TO''DO */\n'
breach '/* -ffast''-math */\n'
breach '/* -O''fast */\n'
breach "/* $(printf '%0120d' 0) */\\n"

found=$(violations "$1")
[ -z "$found" ] || {
    printf '%s\n' "$found"
    exit 1
}
