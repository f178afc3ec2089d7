# A progress bar shows on a terminal alone, and moves inside one picture, whose bytes it does not change.
command -v script >/dev/null && script -qec true /dev/null </dev/null >/dev/null 2>&1 || {
    echo "skip: no pseudo-terminal (script of the package bsdutils, and /dev/pts)"
    exit 77
}
unset XDG_CONFIG_HOME
tall="-p skin --size 512x8192"
ok render "$data/phantom" $tall -o piped.png
[ ! -s err ] || fail "progress printed without a terminal"
TERM=xterm script -qec "'$ctsplat' render '$data/phantom' $tall -o watched.png" /dev/null </dev/null >terminal
cmp piped.png watched.png || fail "watching changes the picture: $(tr '\r' '\n' <terminal)"
# Searching, reading, and the picture in four strips, whose errors are controlled together: from 2 to 3 of 3 steps, 24 marks wide.
bars=$(tr '\r' '\n' <terminal | grep -c '] rendering')
[ "$bars" -ge 5 ] || fail "the bar stands still while a picture is made: $(tr '\r' '\n' <terminal)"
tr '\r' '\n' <terminal | grep -q '\[################        \] rendering' || fail "no beginning"
tr '\r' '\n' <terminal | grep -q '\[##################      \] rendering' || fail "no step in between"
tr '\r' '\n' <terminal | grep -q '\[########################\] rendering' || fail "no end"
TERM=dumb script -qec "'$ctsplat' render '$data/phantom' $tall -o dumb.png" /dev/null </dev/null >terminal
grep -q rendering terminal && fail "a bar on a dumb terminal"
cmp piped.png dumb.png || fail "a dumb terminal changes the picture"
# In a rotation it shows the frame, and the estimated remaining time.
TERM=xterm script -qec "'$ctsplat' render '$data/phantom' -p skin --size 32x32 --rotation 5 -o turned.dcm" /dev/null </dev/null >terminal
for frame in 1 3 5; do
    tr '\r' '\n' <terminal | grep -q "\] frame $frame of 5" || fail "frame $frame is missing in the progress bar"
done
tr '\r' '\n' <terminal | grep -qE '\] frame [2-5] of 5, about [0-9]+ seconds left' || fail "no time left"
# A terminal gets no binary data.
script -qec "'$ctsplat' render '$data/phantom' $tall -o - --format png" /dev/null </dev/null >terminal
grep -q 'standard output is a terminal' terminal || fail "a terminal was written to: $(head -c 100 terminal)"
