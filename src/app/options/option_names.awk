# Every message names an option as `name`, which the table of options has: awk -v table=option_table.c -f option_names.awk FILE...
BEGIN {
    while ((getline < table) > 0)
        if (match($0, /^ *\{[^,]*, "[a-z-]+",/))
            names["`" substr($0, index($0, "\"") + 1, RLENGTH - index($0, "\"") - 2) "`"]
}
index($0, "\"") && !/^ *(\/\*|\*)/ {
    for (text = substr($0, index($0, "\"")); match(text, /`[a-z_-]+`/); text = substr(text, RSTART + RLENGTH))
        if (!(substr(text, RSTART, RLENGTH) in names)) {
            print FILENAME ":" FNR ": " substr(text, RSTART, RLENGTH) " <- no option of this name" >"/dev/stderr"
            failed = 1
        }
}
END { exit failed }
