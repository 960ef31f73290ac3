"""Specs that ship with stc: ``stc list`` names them, ``stc solve NAME`` solves one."""
