# The man page lists the options and commands that --help lists, no more and no fewer.
man=$root/man/ctsplat.1
for command in info render bench check compare presets; do
    ok $command --help all
    cat out >>help
done
grep -oE '^ +(-., )?--[a-z-]+' help | grep -oE -e '--[a-z-]+' | sort -u >help-options
awk '/^\.SH/ { on = $2 == "OPTIONS" } on' "$man" | tr -d '\\' | grep -E '^\.BR? ' | grep -oE -e '--[a-z-]+' |
    grep -vx -e --version | sort -u >man-options
# The first word after .TP is the entry; other mentions are references, which must exist too.
diff help-options man-options >difference || fail "options of --help (<) and of the man page (>) differ: $(cat difference)"

py help_man.py "$work/help" "$man"

ok --help
awk '/^Commands:/ { on = 1; next } /^$/ { on = 0 } on && /^  [a-z]/ { print $1 }' out | sort >help-commands
awk '/^\.SH/ { on = $2 == "COMMANDS" } on && /^\.B / { print $2 }' "$man" | sort >man-commands
diff help-commands man-commands || fail "the commands differ"

# The built-in presets are in their own page: ctsplat's each by name, Slicer's by the first and the last.
ok presets
awk '$NF == "in" && $(NF - 1) == "built" || /built in$/ { print $1 }' out | sed '/^ct-/d' | sort >presets
awk '/^\.SH/ { on = /BUILT-IN/ } on && /^\.BR .*,/ { print }' "$root/man/ctsplat-preset.5" | tr -d '\\' |
    grep -oE '[a-z][a-z0-9-]+' | grep -vxE 'ct-.*|and|mip|minip|average' | sort >listed
diff presets listed >difference || fail "presets (<) and ctsplat-preset(5) (>) differ: $(cat difference)"

ok --version
version=$(sed -n 's/^ctsplat //p' out)
for page in "$root"/man/*.[0-9]; do
    head -2 "$page" | grep -q "\"ctsplat $version\"" || fail "$page is not of version $version"
done
# The newest release of the change list is this one, and later additions are above it.
[ "$(grep -oE '^## [^ ]+' "$root/CHANGELOG.md" | sed -n '1,2s/## //p' | tr '\n' ' ')" = "Unreleased $version " ] ||
    fail "CHANGELOG.md does not begin with Unreleased and $version"
