#!/bin/sh
# Style rules that a script can check: style.sh SOURCE_ROOT
set -eu

# texts ROOT: the files that people write
texts()
{
    (cd "$1" && find . \( -name '.git' -o -name 'build*' -o -path './out' -o -path './testdata' \) -prune -o \
        -type f \( -name '*.c' -o -name '*.cc' -o -name '*.h' -o -name '*.hpp' -o -name '*.py' -o -name '*.sh' -o -name '*.md' -o \
        -name '*.build' -o -name '*.1' -o -name '*.5' -o -name '*.7' -o -name '*.txt' -o -name '*.json' -o -name '*.in' -o -name '*.js' -o \
        -name '*.css' -o -name '*.awk' -o -name '*.bash' -o -name '*.sbatch' -o -name ctsplat-node -o \
        -name dev -o -name run \) -print | LC_ALL=C sort)
}

# The tokens are spelt with a gap so that this file does not hold them.
marks='TO''DO|FIX''ME|(^|[^X])XX''X([^X]|$)|not built ''yet|place''holder|for ''now'
paths='(^|[^a-zA-Z0-9_.])/(wo''rk|fa''rm|ro''ot|ho''me)/'
fast='fast''-math|O''fast'
# Private words, which the terms of the field replace.
private='(^|[^A-Za-z_-])(no''body|a''new|made ag''ain|in va''in|by ch''ance|every so mani''eth|how many''th|at the m''ost|but f''or|to''ld|te''lls|jud''ge[sd]?|kn''ots?|ki''nks?|err''ands?|shel''ved)([^A-Za-z_]|$)'
# Comments begin with a noun or a verb.
clause='/\* (Wh''at|Wh''ere|Wh''ether) |"""(Wh''at|Wh''ere|Wh''ether) '
# Functions that mean the same in each file: methods of tables, orders, callbacks of libraries.
shared='add_rows|begin|finish|release|render|free_cache|next|gradient|wanted|sink|on_[a-z]+|by_[a-z]+'
# Documents that are not in the tree: their contents are in the manual pages.
outside='(^|[^A-Za-z_])(INTER''FACE|ALGO''RITHMS|CONVEN''TIONS|FAU''LTS)([^A-Za-z_]|$)'

violations()
{
    tab=$(printf '\t')
    (
        cd "$1"
        texts . >"$work/list"
        # look TEXT GREP_ARGUMENT...: what grep finds is a violation
        look()
        {
            what=$1
            shift
            tr '\n' '\0' <"$work/list" | xargs -0 grep -n "$@" /dev/null | sed "s|\$| <- $what|"
        }
        look 'blank at the end of a line' -E "[$tab ]+\$"
        look 'tab' "$tab"
        look 'path of a machine' -E "$paths"
        look 'mark of unfinished work' -iE "$marks"
        look 'unsafe floating point' -E -e "-f($fast)|-$fast" | grep -v -e '-fno-' || true
        look 'a document that is not in the tree' -E "$outside"
        look 'a private word' -E "$private" | grep -v -E -e '^\./CHANGELOG\.md:' || true
        look 'a comment that begins with a relative clause' -E "$clause"
        # Of a block of comment lines only the first one counts.
        grep -E '\.(py|sh|build|awk|bash)$|/(dev|run|ctsplat-node)$' "$work/list" | tr '\n' '\0' | xargs -0 awk '
            FNR == 1 { inside = 0 }
            /^ *# (Wh''at|Wh''ere|Wh''ether) / && !inside {
                print FILENAME ":" FNR ": " $0 " <- a comment that begins with a relative clause"
            }
            { inside = /^ *#/ }' /dev/null
        # A Markdown file that is named must be there.
        tr '\n' '\0' <"$work/list" | xargs -0 grep -onHE '[A-Za-z0-9_-]+\.md\b' /dev/null |
            sort -t: -k3,3 -u | while IFS=: read -r f n name; do
            grep -qxE ".*/$name" "$work/list" || echo "$f:$n: $name <- a document that is not in the tree"
        done
        # File names are unique, so that a name identifies a file.
        grep -E '^\./(src|include|tests)/' "$work/list" | grep -vE '/(meson\.build|README\.md)$' | sed 's|.*/||' | sort | uniq -d |
            sed 's|$| <- the name of several files|'
        # Types have names of their own too; each engine has a March.
        grep -E '^\./src/.*\.(c|cc|h)$' "$work/list" | tr '\n' '\0' |
            xargs -0 sed -nE 's/^typedef (struct|enum|union) ([A-Za-z0-9_]+) \{.*/\2/p' /dev/null | sort | uniq -d | grep -vx March |
            sed 's|$| <- the name of several types|'
        # Functions too, except the methods of tables, the orders of qsort(), callbacks of libraries, and templates.
        grep -E '^\./src/.*\.(c|cc)$' "$work/list" | tr '\n' '\0' | xargs -0 awk -v shared="$shared" '
            /^(static|INLINE|_Noreturn|CTS_TARGET_)/ && !/;$/ {
                if (match($0, /[ *][a-z][a-z0-9_]*\(/) && !index(substr($0, 1, RSTART), "=")) {
                    name = substr($0, RSTART + 1, RLENGTH - 2)
                    if (name in file && file[name] != FILENAME && name !~ "^(" shared ")$")
                        print FILENAME ": " name "() <- the name of a function in " file[name]
                    file[name] = FILENAME
                }
            }'
        # The build checks its sources alone, this headers and templates too.
        grep -E '\.(c|h|cc)$' "$work/list" | grep -v '^\./tests' | tr '\n' '\0' |
            xargs -0 awk -v table="$options/option_table.c" -f "$options/option_names.awk" 2>&1 || true
        # src/README.md lists every folder.
        for room in $(sed -n 's|^\./src/\(.*\)/[^/]*\.[ch]c*$|\1|p' "$work/list" | sort -u); do
            [ ! -e src/README.md ] || grep -q "^| .$room. |" src/README.md || echo "src/README.md: no folder $room"
        done
        # All last characters at once, and file by file where one of them is not a newline.
        tr '\n' '\0' <"$work/list" | xargs -0 tail -qc 1 | grep -q . && while read -r f; do
            [ -z "$(tail -c 1 "$f")" ] || echo "$f: no newline at the end"
        done <"$work/list"
        grep -E '\.(c|h|cc|hpp)$' "$work/list" | tr '\n' '\0' |
            xargs -0 awk 'length > 120 { print FILENAME ":" FNR ": more than 120 columns" }' /dev/null
        # A function that a comment or a README names, as name(), occurs in the code; those of libpng and libwebp need not.
        grep -E '\.(c|h|cc|hpp)$|/README\.md$' "$work/list" | tr '\n' '\0' | xargs -0 awk '
            FNR == 1 { all = FILENAME ~ /\.md$/; inside = all }
            {
                line = $0
                code = comment = ""
                while (line != "") {
                    at = all ? 0 : index(line, inside ? "*/" : "/*")
                    part = at ? substr(line, 1, at - 1) " " : line
                    if (inside)
                        comment = comment part
                    else
                        code = code part
                    line = at ? substr(line, at + 2) : ""
                    inside = at ? !inside : inside
                }
                while (match(code, /[A-Za-z_][A-Za-z0-9_]*/)) {
                    used[substr(code, RSTART, RLENGTH)]
                    code = substr(code, RSTART + RLENGTH)
                }
                while (match(comment, /[A-Za-z_][A-Za-z0-9_]*\(\)/)) {
                    name = substr(comment, RSTART, RLENGTH - 2)
                    if (!(name in where))
                        where[name] = FILENAME ":" FNR
                    comment = substr(comment, RSTART + RLENGTH)
                }
            }
            END {
                for (name in where)
                    if (!(name in used) && name !~ /^(png_|WebP)/)
                        print where[name] ": " name "() <- a function that is not in the tree"
            }' /dev/null
    )
}

options=$(realpath "$1")/src/app/options
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

# The check must see each of these.
n=0
breach()
{
    n=$((n + 1))
    printf '%b' "$1" >"$work/breach-$n-.c"
}
breach 'int a; \n'
breach '\tint a;\n'
breach 'int a;'
breach '/* see /ro''ot/x */\n'
breach '/* TO''DO */\n'
breach '/* -ffast''-math */\n'
breach '/* as ALGO''RITHMS section 7 has it */\n'
breach '/* see no-such''.md */\n'
breach '/* no''body does */\n'
breach '/* Wh''at it does. */\n'
breach '/* -O''fast */\n'
breach '/* as no_such_function() does */\n'
breach 'const char a[] = "`max_error` is no option";\n'
breach "/* $(printf '%0120d' 0) */\\n"
mkdir -p "$work/src/x" "$work/src/y"
touch "$work/src/x/same.c" "$work/src/y/same.c"
printf 'typedef struct Twice {\nstatic int twice(void)\n' | tee "$work/src/x/one.c" >"$work/src/y/two.c"
found=$(violations "$work")
for breach in $(seq -f 'breach-%.0f-' $n) same.c Twice 'twice()'; do
    case $found in
        *"$breach"*) ;;
        *)
            echo "style.sh is blind to $breach: $(cat "$work/$breach"* 2>/dev/null)"
            exit 1
            ;;
    esac
done

found=$(violations "$1")
[ -z "$found" ] || {
    printf '%s\n' "$found"
    exit 1
}
