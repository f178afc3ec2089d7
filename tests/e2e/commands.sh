# Every command of README.md, man/recipes.md and the manuals' examples runs unchanged, a page in one folder, in order. bench, batch
# and rotations get small pictures, to save time; a command with a PACS fails only since it is missing; a server is
# ended once it has printed its address. Sanitizers check as much in a small picture.
[ "$CTS_SANITIZE" = none ] && large=' no such line' || large=
# Looks by name need a series whose labels have these names.
shared=$root/../shared/data
[ -d "$shared/body-j2k" ] && no_shared=' no such line' || no_shared=
mkdir -p bin archive
ln -s "$ctsplat" bin/ctsplat
cp -r "$data/phantom" archive/first
PATH=$work/bin:$PATH

# commands PAGE: lines indented as code, or those of a manual's EXAMPLES, without what makes them bold
commands()
{
    case $1 in
        *.md) grep -E '^    ctsplat ' "$1" | sed 's/^    //' ;;
        *) awk '/^\.SH/ { on = $2 == "EXAMPLES" } on' "$1" | sed -n 's/^\.B \(ctsplat .*\)/\1/p' | tr -d '\\' |
            sed 's| /archive| ../archive|' ;;
    esac
}

try()
{
    last=$1 code=0
    sh -c "$1" >"$work/out" 2>"$work/err" </dev/null || code=$?
}

n=0
for page in "$root/README.md" "$root/man/recipes.md" "$root"/man/*.[0-9]; do
    mkdir -p "$work/page/scans"
    cd "$work/page"
    for series in head chest skull; do
        ln -s "$data/phantom" scans/$series
    done
    ln -s "$shared/body-j2k" scans/trunk
    ln -s "$shared/other/mr-head" scans/brain
    ln -s "$shared/other/pet-body" scans/pet
    ln -s "$shared/labels/body-j2k/31-organs.nii.gz" scans/organs.nii.gz
    ln -s ../archive archive
    cp "$root/man/glass.json" "$root/man/trunk.json" .
    cp "$data/fuzz/labels/binary" scans/organs.dcm
    commands "$page" >../commands
    while IFS= read -r line <&3; do
        n=$((n + 1))
        case $line in
            *' scans/trunk '*"$no_shared" | *' scans/brain '*"$no_shared" | *' scans/pet '*"$no_shared")
                echo "skipped: $line (no $shared)" ;;
            *' --from '*)
                try "$line"
                [ "$code" != 2 ] && grep -q 'pacs.example.org' ../err || fail "exit code $code: $(cat ../err)" ;;
            'ctsplat serve '*)
                sh -c "exec $line --listen 127.0.0.1:0" >../out 2>../err </dev/null &
                for wait in $(seq 200); do grep -q '^http://' ../out && break; sleep 0.1; done
                code=0
                kill $!
                wait $! || code=$?
                [ "$code" = 0 ] && grep -q '^http://' ../out || fail "exit code $code: $(cat ../err)" ;;
            *' bench '* | *' batch '* | *' --rotation '*)
                try "$line --size 24x24"
                [ "$code" = 0 ] || fail "exit code $code: $(cat ../err)" ;;
            *' render '*"$large")
                try "$line --size 64x64"
                [ "$code" = 0 ] || fail "exit code $code: $(cat ../err)" ;;
            *)
                try "$line"
                [ "$code" = 0 ] || fail "exit code $code: $(cat ../err)" ;;
        esac
    done 3<../commands
    case $page in
        */README.md) [ -s head.png ] || fail "no picture by README.md" ;;
        *.md) [ -s bone.png ] && [ -s preview.jpg ] && [ -s chest.jpg ] && [ -s turn.webp ] || fail "pictures are missing" ;;
    esac
    cd "$work" && rm -r page
done
[ $n -ge 16 ] || fail "only $n commands were found"
