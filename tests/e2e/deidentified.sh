# --deidentify: the basic profile's table, and UIDs under a key that one site has and another has not.
python=/usr/bin/python3
[ -x $python ] || python=python3
key=$work/state/ctsplat/key
export XDG_STATE_HOME="$work/state"

ok render "$data/phantom" --size 32x32 -o plain.dcm
[ ! -e state ] || fail "a key that nothing needs"
ok render "$data/phantom" --size 32x32 --deidentify -o one.dcm --log log
[ "$(stat -c %a "$key")" = 600 ] || fail "the key is not its owner's alone"
cp "$key" first
ok render "$data/phantom" --size 32x32 --deidentify -o two.dcm --log log
cmp "$key" first || fail "the key was created again"
ok render "$data/phantom" --size 32x32 --deidentify --key first -o same.dcm --log log
head -c 32 /dev/urandom >other
ok render "$data/phantom" --size 32x32 --deidentify --key other -o other.dcm --log log
[ "$(grep -ho '"series_uid_hash":"[^"]*"' log | uniq -c | awk '{print $1}' | tr '\n' ' ')" = '3 1 ' ] ||
    fail "the log's hash does not follow the key"
uids() { grep -aoE '2\.25\.[0-9]{20,}|ANON-[0-9A-F]{16}' "$1" | grep -v 67028870792169200667320284542246776385 | sort -u; }
[ "$(uids one.dcm)" = "$(uids two.dcm)" ] && [ "$(uids one.dcm)" = "$(uids same.dcm)" ] || fail "a site does not repeat"
uids one.dcm >a
uids other.dcm >b
uids plain.dcm >c
for file in b c; do
    grep -E 'ANON' a | grep -qFf - $file && fail "two sites give one name"
done
[ "$(comm -12 a b | wc -l)" = "$(comm -12 a c | wc -l)" ] || fail "two sites share UIDs"
printf short >bad
refused 3 'is no key' render "$data/phantom" --size 32x32 --deidentify --key bad -o bad.dcm
refused 3 'cannot be read' render "$data/phantom" --size 32x32 --deidentify --key nowhere -o bad.dcm

# A batch: folders, journal, sheet and the reasons in them name series by the new UIDs; a shard makes no key.
rm -rf state
run batch "$data/geometry" -O shard --size 32x32 --formats dcm --deidentify --shard 0/2
[ "$code" = 3 ] && has err 'the key cannot be read' || fail "a shard starts without a key"
[ ! -e state/ctsplat/key ] || fail "a shard makes a key"
run batch "$data/geometry" -O batch --size 32x32 --formats dcm,png --deidentify
[ "$code" = 8 ] || fail "exit code $code"
for name in mixed-patients two-phases coronal many-missing; do
    own=$("$ctsplat" info "$data/geometry/$name" --json | grep -oE '"series_uid": ?"[^"]*' | head -1 | sed 's/.*"//')
    [ "${#own}" -gt 5 ] || fail "no UID of $name"
    # A random UID may begin like it.
    ! grep -rqE "$(printf %s "$own" | sed 's/\./[.]/g')([^0-9]|\$)" batch || fail "the batch contains the UID of $name"
    [ ! -e "batch/$own" ] || fail "a folder of $name's own UID"
done
ls batch >before
run batch "$data/geometry" -O batch --size 32x32 --formats dcm,png --deidentify
has err '11 of them in earlier runs'
ls batch | cmp - before || fail "another run gives other folders"

$python -c 'import pydicom' 2>/dev/null || exit 77
cp -r "$data/syntax/explicit" full
$python "$root/tests/e2e/deidentified.py" fill full || fail "the profile's attributes cannot be filled in"
ok render full --size 32x32 --deidentify -o full.dcm
$python "$root/tests/e2e/deidentified.py" check full.dcm full || fail "the profile is not kept"
ok render full --size 32x32 --rotation 3 --deidentify -o turn.dcm
$python "$root/tests/e2e/deidentified.py" check turn.dcm full || fail "the profile is not kept by a rotation"
