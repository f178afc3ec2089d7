# Table removal on real series, where they are at hand: the table goes, the patient does not, and nothing is in doubt.

shared=$root/../shared/data
[ -d "$shared/chest-ge" ] || {
    echo "SKIP: the shared samples are not here"
    exit 77
}

# goes SERIES LEAST MOST: cm3 of dense things that go
goes()
{
    ok render "$shared/$1" --size 64x64 -o out.png --force --log log.jsonl
    grep '"table_removed"' log.jsonl >line || fail "$1: nothing goes"
    ! grep -q table_removal_uncertain log.jsonl || fail "$1: in doubt"
    grep -q '"event":"table".*"lost_percent":0\(\.0[0-9]*\)\?}' log.jsonl || fail "$1: 0.1 % of the body is lost"
    cm3=$(sed 's/.*went (\([0-9]*\)\..*/\1/' line)
    [ "$cm3" -ge "$2" ] && [ "$cm3" -le "$3" ] || fail "$1: $cm3 cm3 go, not $2 to $3"
    rm log.jsonl
}

# The GE table, its cradle and the mattress's cover are 950 cm3, by hand; the skull's tray is 180, the holder's shells 75: no tenth may stay.
goes chest-ge 900 980
goes head-phantom/S2020 170 190
goes head-tilt-ge 74 80
