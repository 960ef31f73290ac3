"""MuJoCo models that ship with stc, and the programs that build them."""
