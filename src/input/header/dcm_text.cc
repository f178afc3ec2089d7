/* Text values by DICOM's own grammar, whatever the locale. */
#include "input/header/dcm_read.h"

#include <charconv>
#include <cmath>
#include <string_view>

namespace
{

std::string_view trimmed(std::string_view text)
{
    while (!text.empty() && (text.back() == ' ' || text.back() == '\0'))
        text.remove_suffix(1);
    while (!text.empty() && text.front() == ' ')
        text.remove_prefix(1);
    return text;
}

size_t digits(std::string_view &text)
{
    size_t n = 0;
    while (n < text.size() && text[n] >= '0' && text[n] <= '9')
        n++;
    text.remove_prefix(n);
    return n;
}

void sign(std::string_view &text)
{
    if (!text.empty() && (text[0] == '+' || text[0] == '-'))
        text.remove_prefix(1);
}

/* from_chars alone would take "inf", "nan" and a number with something behind it. */
bool is_decimal(std::string_view text)
{
    sign(text);
    size_t n = digits(text);
    if (!text.empty() && text[0] == '.') {
        text.remove_prefix(1);
        n += digits(text);
    }
    if (n == 0)
        return false;
    if (!text.empty() && (text[0] == 'e' || text[0] == 'E')) {
        text.remove_prefix(1);
        sign(text);
        if (digits(text) == 0)
            return false;
    }
    return text.empty();
}

bool parse_one(std::string_view text, double *value)
{
    text = trimmed(text);
    if (text.size() > 64 || !is_decimal(text))
        return false;
    if (text[0] == '+')
        text.remove_prefix(1);
    const auto result = std::from_chars(text.data(), text.data() + text.size(), *value);
    return result.ec == std::errc() && std::isfinite(*value);
}

} // namespace

int cts_dcm_parse_ds(const char *text, size_t n_bytes, double *values, int n_values)
{
    std::string_view rest(text, n_bytes);
    for (int i = 0; i < n_values; i++) {
        const size_t end = rest.find('\\');
        if ((end == std::string_view::npos) != (i == n_values - 1) || !parse_one(rest.substr(0, end), &values[i]))
            return 0;
        if (end != std::string_view::npos)
            rest.remove_prefix(end + 1);
    }
    return 1;
}

int cts_dcm_parse_is(const char *text, size_t n_bytes, int *value)
{
    std::string_view s = trimmed(std::string_view(text, n_bytes));
    if (s.size() > 64)
        return 0;
    if (s.size() > 1 && s[0] == '+' && s[1] != '-')
        s.remove_prefix(1);
    const auto result = std::from_chars(s.data(), s.data() + s.size(), *value);
    return result.ec == std::errc() && result.ptr == s.data() + s.size();
}
