# The man page lists the options and commands that --help lists, no more and no fewer.
man=$root/man/ctsplat.1
for command in info render bench check compare presets; do
    ok $command --help
    cat out >>help
done
grep -oE '^ +(-., )?--[a-z-]+' help | grep -oE -e '--[a-z-]+' | sort -u >help-options
awk '/^\.SH/ { on = $2 == "OPTIONS" } on' "$man" | tr -d '\\' | grep -E '^\.BR? ' | grep -oE -e '--[a-z-]+' |
    grep -vx -e --version | sort -u >man-options
# The first word after .TP is the entry; other mentions are references, which must exist too.
diff help-options man-options >difference || fail "options of --help (<) and of the man page (>) differ: $(cat difference)"

ok --help
awk '/^Commands:/ { on = 1; next } /^$/ { on = 0 } on && /^  [a-z]/ { print $1 }' out | sort >help-commands
awk '/^\.SH/ { on = $2 == "COMMANDS" } on && /^\.B / { print $2 }' "$man" | sort >man-commands
diff help-commands man-commands || fail "the commands differ"

# Every option has an entry of its own.
for option in $(cat help-options); do
    tr -d '\\' <"$man" | grep -A1 '^\.TP' | grep -qE "^\.BR? .*$option( |\"|\$)" || fail "$option has no entry in the man page"
done

ok --version
version=$(sed -n 's/^ctsplat //p' out)
for page in "$root"/man/*.[0-9]; do
    head -1 "$page" | grep -q "\"ctsplat $version\"" || fail "$page is not of version $version"
done
